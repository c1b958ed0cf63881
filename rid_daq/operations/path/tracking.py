"""`tracking`: compare measured with commanded positions, joint by joint and along the path."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from rid_daq.blocks.block import AnyBlock, Text, Verdict, note_blocks
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import (
    DEFAULT_RUNS,
    CarriedPayloadOfModel,
    DespiteMisfitOfModel,
    LoadChangeFileOfModel,
    MeasuredPoint,
    Option,
    RunNames,
    RunsFolder,
    Unfinished,
)
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from rid_daq.operations.path.tracked_runs import TrackedRuns
    from rid_daq.report.sections.tracking import ErrorSize


class TrackingRequest(Request):
    """Compare measured with commanded positions, joint by joint and along the path of the tool.

    Runs of several motions, each with its own run to compare with, are shown in one table and in
    one report in the folder of the first run. Only the main part of a motion is compared. The
    kinematics are those of the robot file.
    """

    run: RunNames
    against: Annotated[
        tuple[str, ...],
        Field(
            description="Run of the same motion to compare with, such as a run without feedforward."
        ),
        Option(metavar="RUN"),
    ] = ()
    model: Annotated[
        Path | None,
        Field(
            description="Model file of `identify`; its link torques, without friction, and its"
            " stiffness_nm_rad give the deflection of the gears (default: the measured motor"
            " torques and the run's robot file)."
        ),
        Option(metavar="MODEL", file="input"),
    ] = None
    despite_misfit: DespiteMisfitOfModel = False
    payload: CarriedPayloadOfModel = None
    load_changes: LoadChangeFileOfModel = None
    tracker: Annotated[
        tuple[Path, ...],
        Field(
            description="File of a laser tracker that measured the tool during the run, one for"
            " each run: columns time_s and x_m, y_m, z_m or x_mm, y_mm, z_mm. Its clock and frame"
            " are estimated."
        ),
        Option(metavar="FILE", file="input"),
    ] = ()
    point: Annotated[
        MeasuredPoint, Option(metavar="X,Y,Z", unit="m", separator=",", needs="tracker")
    ] = None
    unfinished: Unfinished = False
    runs: RunsFolder = DEFAULT_RUNS


@dataclass(frozen=True)
class TrackingResult:
    """Path errors of runs.

    Attributes:
        tracked: The pairs of runs, their section of a report, and notes.
    """

    tracked: TrackedRuns

    def document(self) -> dict[str, object]:
        """Return the path errors as numbers."""
        section = self.tracked.section
        return {
            "motions": self._motion_documents(),
            "measured_at": "motor encoders",
            "unseen": section.unseen,
            "tool_side": [size.model_dump() for size in section.tool_side],
            "with_stiffness": section.with_stiffness,
            "without_stiffness": section.without_stiffness,
            "notes": self.tracked.notes,
            "report": str(self.tracked.report),
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield notes, the errors before and after, the verdict, and the report's path."""
        from rid_daq.report.section_blocks.tracking import tracking_blocks

        yield from note_blocks(self.tracked.notes)
        yield from tracking_blocks(self.tracked.section)
        yield Verdict(passed=None, text=self.tracked.section.verdict.headline)
        yield Text(text=f"Report: {self.tracked.report}", is_for_terminal=True)

    def _motion_documents(self) -> list[dict[str, object]]:
        joints = self.tracked.pairs[0][0].data.robot.joint_names
        return [
            {
                "run": one.run_id,
                "use": motion.use,
                **_error_document(motion.after, joints),
                "against": None
                if before is None or motion.before is None
                else {"run": before.run_id, **_error_document(motion.before, joints)},
                "mean_ratio": motion.mean_ratio,
                "max_ratio": motion.max_ratio,
            }
            for (one, before), motion in zip(
                self.tracked.pairs, self.tracked.section.motions, strict=True
            )
        ]


def _error_document(size: ErrorSize, joints: tuple[str, ...]) -> dict[str, object]:
    return {
        "mean_m": size.mean_m,
        "max_m": size.max_m,
        "joint_peak": dict(zip(joints, size.joint_peak, strict=True)),
        "bending": None if size.bending is None else size.bending.model_dump(),
    }


def run(request: TrackingRequest, _context: Context) -> TrackingResult:
    """Compare positions and write the report."""
    from rid_daq.operations.path.tracked_runs import track_runs

    return TrackingResult(track_runs(request))


OPERATION: Final = Operation(
    name="tracking",
    label="Compare path errors",
    request=TrackingRequest,
    run=run,
    examples=(
        "tracking compensated --against plain",
        "tracking circle-ff square-ff --against circle --against square --json",
        "tracking compensated --model model.json",
        "tracking compensated --tracker tracker.csv",
    ),
    module="rid_daq.operations.path.tracked_runs",
)
