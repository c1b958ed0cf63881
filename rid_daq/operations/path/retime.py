"""`retime`: compute the fastest timing of a path within the torque limits of a model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, TypedDict

from pydantic import Field

from config.ranges import Confidence, FreeShare, Rate
from identification.choices import BaseMassKg
from rid_daq.blocks.block import AnyBlock, Next, note_blocks
from rid_daq.operations.operation import Context, Operation
from rid_daq.operations.path.shared import ModelFile, Temperature
from rid_daq.requests.option import (
    DEFAULT_RUNS,
    FILES,
    CarriedPayload,
    CellName,
    DespiteMisfit,
    Option,
    Overwrite,
    RunsFolder,
)
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from rid_daq.operations.path.retiming import RetimedMotion

LIMITS: Final = "Limits"
DEFAULT_CONFIDENCE: Final = 0.95


class RetimeRequest(Request):
    """Compute the fastest timing of a path within the torque limits of a model.

    The path is unchanged. Its speed follows from the limits of the robot file (speed, acceleration
    and torque of each joint) and from the options below. Every row of the result is checked with
    the model. Nothing moves: the result is a motion file for the cycle time of this cell. If a
    limit cannot be kept, the message names it and, if known, the pose.

    In a terminal: exit code 3 if a limit cannot be kept.
    """

    cell: CellName
    motion: Annotated[
        Path,
        Field(
            description="Motion file of kind joint_path, path, circle, joint_table or multipoint."
        ),
        Option(positional=True, metavar="MOTION", file="input"),
    ]
    model: ModelFile
    output: Annotated[
        Path,
        Field(description="Motion file to write."),
        Option(short="o", metavar="MOTION", group=FILES, file="output", endings=(".yaml",)),
    ]
    despite_misfit: DespiteMisfit = False
    payload: CarriedPayload = None
    confidence: Annotated[
        Confidence,
        Field(
            description="Probability with which each torque is within its limit at one instant;"
            " 0 uses the model without a margin."
        ),
        Option(group=LIMITS),
    ] = DEFAULT_CONFIDENCE
    margin: Annotated[
        FreeShare,
        Field(
            description="Additional margin: fraction of the limits of torques and base wrench that"
            " stays unused."
        ),
        Option(group=LIMITS),
    ] = 0.0
    torque_rate: Annotated[
        tuple[Rate, ...],
        Field(description="Largest rate of the torques: one value, or one per joint."),
        Option(group=LIMITS, unit="N m/s", metavar="NM_S"),
    ] = ()
    jerk: Annotated[
        tuple[Rate, ...],
        Field(description="Largest jerk: one value, or one per joint."),
        Option(group=LIMITS, unit="rad/s³", metavar="RAD_S3"),
    ] = ()
    torque_rms: Annotated[
        tuple[Rate, ...],
        Field(description="Largest RMS torque: one value, or one per joint."),
        Option(group=LIMITS, unit="N m", metavar="NM", flag="rms-torque"),
    ] = ()
    base: Annotated[
        bool,
        Field(
            description="Keep the reaction on the base within the limits of the cell's force"
            " plate; needs a combined model."
        ),
        Option(group=LIMITS, flag="base-limits"),
    ] = False
    mass_kg: Annotated[
        BaseMassKg | None,
        Field(description="Total mass that the base carries; the robot file's if not set."),
        Option(group=LIMITS, unit="kg", flag="mass", needs="base"),
    ] = None
    temperature: Temperature = None
    report: Annotated[
        Path | None,
        Field(description="Report to write (HTML), with plots."),
        Option(group=FILES, metavar="PAGE", file="output", endings=(".html",)),
    ] = None
    overwrite: Overwrite = False
    runs: RunsFolder = DEFAULT_RUNS


class RetimeDocument(TypedDict):
    """Timing of a path, and the used fraction of each limit."""

    motion: str
    report: str | None
    moving_s: float
    original_s: float
    shorter_percent: float
    rows: int
    scans: int
    off_the_path: float
    joints: list[dict[str, object]]
    base: list[dict[str, object]]
    notes: Sequence[str]


@dataclass(frozen=True)
class RetimeResult:
    """A path that was retimed and written.

    Attributes:
        request: The request.
        made: The motion, its section of a report, and notes.
    """

    request: RetimeRequest
    made: RetimedMotion

    def document(self) -> RetimeDocument:
        """Return the timing and the used fraction of each limit as numbers."""
        section, report = self.made.section, self.request.report
        return {
            "motion": str(self.request.output),
            "report": None if report is None else str(report),
            "moving_s": section.moving_s,
            "original_s": section.original_s,
            "shorter_percent": section.shorter_percent,
            "rows": section.rows,
            "scans": section.scans,
            "off_the_path": self.made.timed.off,
            "joints": [joint.model_dump(mode="json") for joint in section.joints],
            "base": [base.model_dump(mode="json") for base in section.base or ()],
            "notes": self.made.notes,
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield notes, each joint's use of its limits, the duration, and the next command."""
        from rid_daq.report.section_blocks.retiming import retiming_blocks

        yield from note_blocks(self.made.notes)
        yield from retiming_blocks(self.made.section)
        yield Next(words=("record", self.request.cell, str(self.request.output)))


def run(request: RetimeRequest, _context: Context) -> RetimeResult:
    """Retime the path, and write the motion."""
    from rid_daq.operations.path.retiming import retime_motion

    return RetimeResult(request, retime_motion(request))


OPERATION: Final = Operation(
    name="retime",
    label="Retime a path to its limits",
    request=RetimeRequest,
    run=run,
    examples=(
        "retime ir361 path.yaml --model model.json --output fast.yaml",
        "retime ir361 path.yaml --model model.json --output fast.yaml --payload payload.json"
        " --margin 0.1 --report fast.html",
    ),
    module="rid_daq.operations.path.retiming",
)
