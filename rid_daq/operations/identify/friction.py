"""`friction`: measure the friction of the joints alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, TypedDict

from pydantic import Field

from rid_daq.blocks.block import AnyBlock, Text, note_blocks
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import DEFAULT_RUNS, Option, RunNames, RunsFolder, Unfinished
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from rid_daq.operations.identify.friction_measurement import FrictionMeasurement


class FrictionRequest(Request):
    """Measure the friction of each joint alone: torque over speed, and the models that fit it.

    RUN is a recording of a motion at constant speeds, or of a path that is driven forward and
    backward; `rid-daq design --kind constant-velocity` or `--kind reversed` writes the motion.
    Several runs of one robot are evaluated together. With --against, the friction of other runs is
    shown for comparison, such as that of a cold robot.

    In a terminal: exit code 6 if no model fits the friction of a joint.
    """

    run: RunNames
    against: Annotated[
        tuple[str, ...],
        Field(
            description="Run of the same robot whose friction is shown for comparison, such as one"
            " with a cold robot or with a payload."
        ),
        Option(metavar="RUN"),
    ] = ()
    runs: RunsFolder = DEFAULT_RUNS
    model: Annotated[
        Path | None,
        Field(description="Model file; its friction is compared with the measured friction."),
        Option(metavar="MODEL", file="input"),
    ] = None
    unfinished: Unfinished = False


class FrictionDocument(TypedDict):
    """Curves and models of friction."""

    run: str
    friction: object
    notes: Sequence[str]
    report: str


@dataclass(frozen=True)
class FrictionResult:
    """Measured friction, and its report.

    Attributes:
        found: The measured friction and the paths of its files.
    """

    found: FrictionMeasurement

    @property
    def exit_code(self) -> int:
        """Exit code 6 if no model fits the friction of a joint."""
        from rid_daq.terminal.exit_codes import ExitCode

        return ExitCode.DATA_QUALITY if self.found.section.bad_joints else ExitCode.DONE

    def document(self) -> FrictionDocument:
        """Return curves and models as numbers."""
        found = self.found
        return {
            "run": found.run_id,
            "friction": found.section,
            "notes": found.notes,
            "report": str(found.report),
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield notes, curves and models of each joint, and the report's path."""
        from rid_daq.report.section_blocks.friction import friction_blocks

        yield from note_blocks(self.found.notes)
        yield from friction_blocks(self.found.section)
        yield Text(text=f"Report: {self.found.report}", is_for_terminal=True)


def run(request: FrictionRequest, _context: Context) -> FrictionResult:
    """Measure the friction and write the report."""
    from rid_daq.operations.identify.friction_measurement import measure_friction

    return FrictionResult(measure_friction(request))


OPERATION: Final = Operation(
    name="friction",
    label="Measure friction",
    request=FrictionRequest,
    run=run,
    examples=(
        "friction latest",
        "friction slow fast --model model.json --json",
        "friction warm --against cold --against loaded",
    ),
    module="rid_daq.operations.identify.friction_measurement",
)
