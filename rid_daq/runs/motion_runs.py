"""Runs of a motion as they were driven: planned samples, feedforward, and what was measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from acquisition.motion.motion_file import AnyMotion, load_motion
from acquisition.motion.samples import MotionSamples
from acquisition.runs.folder import RunFolder
from compensation.feedforward.file import FeedforwardFile, read_feedforward
from config.cell.cell import CellConfig
from config.errors import DataQualityError
from rid_daq.runs.run_data import FEEDFORWARD, MOTION, ONLINE_MODEL, RunData

PLAIN: Final = "plain"


@dataclass(frozen=True)
class MotionRun:
    """A run of this program's own, with the motion that it drove.

    Attributes:
        data: What was measured, and the robot.
        cell: The cell as used.
        motion: The motion file as used.
        file: What pre-compensated it, where a file did.
        streamed: Whether it was compensated on line, by a feedforward that no file holds.
    """

    data: RunData
    cell: CellConfig
    motion: AnyMotion
    file: FeedforwardFile | None
    streamed: bool = False

    @property
    def run_id(self) -> str:
        """The run's id."""
        return self.data.folder.run_id

    def samples(self) -> MotionSamples:
        """Return the motion as it was planned, with its feedforward.

        Raises:
            DataQualityError: The run was streamed.
        """
        if self.streamed:
            raise DataQualityError(
                f"run {self.run_id} was streamed: what compensated it was computed on line and is"
                " not kept. Record the motion, plainly or with --feedforward, and use that run",
                code="RID-RUN-FOREIGN",
            )
        planned = self.motion.plan(self.data.robot, self.cell.cycle_time_s).whole()
        return planned if self.file is None else self.file.onto(planned)

    @property
    def use(self) -> str:
        """Say whether this motion's own runs have made its feedforward."""
        if self.streamed:
            return "streamed"
        if self.file is None:
            return PLAIN
        origin = self.file.origin
        if origin.refinements:
            times = len(origin.refinements)
            return f"refined {times} time{'' if times == 1 else 's'}"
        if origin.tuning is not None and origin.tuning.same_motion:
            return "tuned on it"
        return "never used"


def read_motion_run(folder: RunFolder, *, unfinished: bool = False) -> MotionRun:
    """Read a run with its motion; `unfinished` as in `RunData.load`.

    Raises:
        ConfigError, DataQualityError, RecordingError: It has none, or cannot be read.
    """
    data = RunData.load(folder, unfinished=unfinished)
    cell, motion = data.cell, folder.file(MOTION)
    if cell is None or not motion.exists():
        raise DataQualityError(
            f"run {folder.run_id} says nothing of where the robot should have been: a run of this"
            " program's own is needed",
            code="RID-RUN-FOREIGN",
        )
    ahead = folder.file(FEEDFORWARD)
    return MotionRun(
        data=data,
        cell=cell,
        motion=load_motion(motion),
        file=read_feedforward(ahead) if ahead.exists() else None,
        streamed=folder.file(ONLINE_MODEL).exists(),
    )
