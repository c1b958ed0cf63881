"""`calibrate poses`: propose the poses to measure for a kinematic calibration."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from config.plausible import Plausible
from config.ranges import Seed
from rid_daq.blocks.block import AnyBlock, Next, Text, note_blocks
from rid_daq.blocks.formats import number
from rid_daq.operations.calibration.calibrate_kinematics import (
    GravityModel,
    LoadCentre,
    RobotName,
)
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import (
    DEFAULT_RUNS,
    FILES,
    CarriedPayloadOfModel,
    DespiteMisfitOfModel,
    MeasuredPoint,
    Option,
    Overwrite,
    RunsFolder,
)
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from rid_daq.operations.calibration.proposed_poses import ProposedPoses

MOTION: Final = "Motion"


class CalibratePosesRequest(Request):
    """Propose the poses to measure for a kinematic calibration.

    The poses are within the limits of the robot file, clear of its bodies and of the cell's
    workspace, and can be reached without a collision. They are chosen from random poses so that
    they determine the parameters well (D-optimality). With --load, half of them carry a known load.
    The table has empty columns for the measured points. rid-daq does not know the place of the
    instrument: check that it sees the point in each pose, leave hidden poses out, and request some
    more poses than you need.
    """

    robot: RobotName
    output: Annotated[
        Path,
        Field(description="Table of poses to write, with empty columns for the points (CSV)."),
        Option(short="o", metavar="POSES", group=FILES, file="output", endings=(".csv",)),
    ]
    cell: Annotated[
        str | None,
        Field(description="Bundled cell or cell file whose workspace limits the poses."),
        Option(metavar="CELL", file="input"),
    ] = None
    count: Annotated[
        int, Field(ge=10, le=500, description="Number of poses."), Option(metavar="N")
    ] = 40
    load: Annotated[
        float,
        Plausible(0.0, 3e3, "kg"),
        Field(ge=0.0, description="Known load that half of the poses carry; 0 for none."),
        Option(unit="kg"),
    ] = 0.0
    model: GravityModel = None
    despite_misfit: DespiteMisfitOfModel = False
    payload: CarriedPayloadOfModel = None
    point: MeasuredPoint = None
    load_centre: LoadCentre = None
    range_fraction: Annotated[
        float,
        Field(
            ge=0.05,
            le=1.0,
            description="Fraction of each joint's range, around its middle, to use.",
        ),
        Option(),
    ] = 0.9
    seed: Annotated[Seed, Field(description="Random seed of the candidates."), Option()] = 0
    motion: Annotated[
        Path | None,
        Field(description="Motion file to write, which `record` runs: the poses without load."),
        Option(group=MOTION, metavar="MOTION", file="output", endings=(".yaml",)),
    ] = None
    loaded_motion: Annotated[
        Path | None,
        Field(description="Motion file to write, which `record` runs: the poses with load."),
        Option(group=MOTION, metavar="MOTION", file="output", endings=(".yaml",), needs="load"),
    ] = None
    dwell: Annotated[
        float,
        Field(ge=1.0, le=600.0, description="Rest at each pose of the motions."),
        Option(group=MOTION, unit="s"),
    ] = 5.0
    speed_fraction: Annotated[
        float,
        Field(ge=0.01, le=1.0, description="Fraction of the speed limits that the motions use."),
        Option(group=MOTION),
    ] = 0.3
    overwrite: Overwrite = False
    runs: RunsFolder = DEFAULT_RUNS


@dataclass(frozen=True)
class CalibratePosesResult:
    """Proposed poses.

    Attributes:
        request: The request.
        found: The poses, their files and notes.
    """

    request: CalibratePosesRequest
    found: ProposedPoses

    def document(self) -> dict[str, object]:
        """Return poses, parameters, expected spread, files and notes."""
        design = self.found.design
        return {
            "robot": self.found.robot.name,
            "joints": list(self.found.robot.joint_names),
            "poses": [
                {"position": pose.tolist(), "load_kg": float(load), "nominal_m": point.tolist()}
                for pose, load, point in zip(
                    design.position, design.load_kg, design.point_m, strict=True
                )
            ],
            "parameters": [each.name for each in design.parameters],
            "spread_mean": design.spread_mean,
            "spread_max": design.spread_max,
            "files": [str(path) for path in self.found.files],
            "notes": self.found.notes,
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield notes, the numbers of poses and parameters, the expected spread and the files."""
        found, design = self.found, self.found.design
        yield from note_blocks(found.notes)
        geometry = sum(each.kind != "compliance" for each in design.parameters)
        loaded = int((design.load_kg > 0.0).sum())
        yield Text(
            text=f"{len(design.position)} poses, {loaded} of them with load, for {geometry}"
            f" geometric parameters and {len(design.parameters) - geometry} compliances."
        )
        yield Text(
            text="Expected standard deviation of a calibrated coordinate within the joints'"
            f" ranges: on average {number(design.spread_mean, 2)} times that of a measured"
            f" coordinate, at most {number(design.spread_max, 2)} times."
        )
        yield Text(
            text="Check that the instrument sees the point in each pose; leave hidden poses out."
        )
        yield Text(text=f"Written: {', '.join(map(str, found.files))}")
        yield Next(lead="After the measurement", words=self._next_words())

    def _next_words(self) -> tuple[str, ...]:
        request = self.request
        words = ["calibrate", request.robot, str(request.output)]
        if request.model is not None:
            words += ["--model", str(request.model)]
        for flag, place in (("--point", request.point), ("--load-centre", request.load_centre)):
            if place is not None:
                words += [flag, ",".join(f"{value:g}" for value in place)]
        return tuple(words)


def run(request: CalibratePosesRequest, _context: Context) -> CalibratePosesResult:
    """Choose the poses, and write the table and the motions."""
    from rid_daq.operations.calibration.proposed_poses import propose_poses

    return CalibratePosesResult(request, propose_poses(request))


OPERATION: Final = Operation(
    name="calibrate poses",
    label="Propose poses for a kinematic calibration",
    request=CalibratePosesRequest,
    run=run,
    examples=(
        "calibrate poses kr15 --output poses.csv --count 40 --load 13.6 --point 0.12,0.05,-0.10",
        "calibrate poses robot.yaml --output poses.csv --cell cell.yaml --motion poses.yaml",
    ),
    module="rid_daq.operations.calibration.proposed_poses",
)
