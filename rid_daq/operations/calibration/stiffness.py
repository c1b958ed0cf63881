"""`stiffness`: identify stiffness and damping of elastic gears."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from rid_daq.blocks.block import AnyBlock, Next, Text, note_blocks
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import (
    DEFAULT_RUNS,
    MeasuredPoint,
    Option,
    RunNames,
    RunsFolder,
    Unfinished,
)
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from rid_daq.operations.calibration.identified_gears import IdentifiedGears


class StiffnessRequest(Request):
    """Identify stiffness and damping of every gear, together with the robot's parameters.

    Give at least one run of an excitation trajectory and one of a multisine (`rid-daq design --kind
    multisine`), all with the same load. The kind of each run is read from its motion. Files of
    instruments on the link side of the gears make the result more certain. The intervals are two
    standard deviations, at least 2 % of the value. If the runs do not show the stiffness of a
    joint, the result says so and contains no number for it. The result contains keys for the robot
    file, which is not changed.
    """

    run: RunNames
    plate: Annotated[
        bool,
        Field(
            description="Also use the force plate of the excitation runs, which shows the links'"
            " motion independently of the motors."
        ),
        Option(),
    ] = False
    tracker: Annotated[
        tuple[Path, ...],
        Field(
            description="File of a laser tracker that measured a point on the last link, one for"
            " each excitation run, in the order of the runs: columns time_s and x_m, y_m, z_m or"
            " x_mm, y_mm, z_mm. Its clock and frame are estimated."
        ),
        Option(metavar="FILE", file="input"),
    ] = ()
    point: Annotated[
        MeasuredPoint, Option(metavar="X,Y,Z", unit="m", separator=",", needs="tracker")
    ] = None
    link_encoders: Annotated[
        tuple[Path, ...],
        Field(
            description="File of encoders on the link side, one for each excitation run, in the"
            " order of the runs: columns time_s and the joints' names (rad or m; _deg or _mm"
            " appended for other units). Its clock is estimated."
        ),
        Option(metavar="FILE", file="input"),
    ] = ()
    unfinished: Unfinished = False
    runs: RunsFolder = DEFAULT_RUNS


@dataclass(frozen=True)
class StiffnessResult:
    """Gears that were identified.

    Attributes:
        found: The gears and the path of the report.
    """

    found: IdentifiedGears

    @property
    def exit_code(self) -> int:
        """Exit code 6 if the data show the stiffness of no joint."""
        from rid_daq.terminal.exit_codes import ExitCode

        return 0 if self.found.section.keys else ExitCode.DATA_QUALITY

    def document(self) -> dict[str, object]:
        """Return the gears as numbers, and the keys of the robot file."""
        found = self.found
        return {
            **found.section.model_dump(mode="json"),
            "robot_file": found.section.keys,
            "notes": found.notes,
            "report": str(found.report),
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield notes, the gears, the report's path and the next command."""
        from rid_daq.report.section_blocks.gears import gear_blocks

        found = self.found
        yield from note_blocks(found.notes)
        yield from gear_blocks(found.section)
        yield Text(text=f"Report: {found.report}", is_for_terminal=True)
        if found.section.keys:
            yield Text(
                text="Write the keys into the robot file; then identify the model again with these"
                " gears and compensate with it."
            )
            yield Next(
                words=("identify", *found.excitations, "--gears", "robot.yaml", "-o", "model.json")
            )


def run(request: StiffnessRequest, _context: Context) -> StiffnessResult:
    """Identify the gears and write the report."""
    from rid_daq.operations.calibration.identified_gears import identify_gears

    return StiffnessResult(identify_gears(request))


OPERATION: Final = Operation(
    name="stiffness",
    label="Identify the gears' stiffness",
    request=StiffnessRequest,
    run=run,
    examples=(
        "stiffness excitation-1 excitation-2 multisine",
        "stiffness excitation-1 excitation-2 multisine --plate --json",
        "stiffness excitation-1 excitation-2 multisine --tracker path-1.csv --tracker path-2.csv",
    ),
    module="rid_daq.operations.calibration.identified_gears",
)
