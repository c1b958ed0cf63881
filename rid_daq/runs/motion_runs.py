"""`MotionRun`: run of a motion, with its planned samples, its feedforward and its recording."""

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
    """A run that rid-daq has recorded, with its motion.

    Attributes:
        data: The recording and the robot.
        cell: The cell as it was in the run.
        motion: The motion file as it was in the run.
        file: Feedforward file of the run; None without one.
        streamed: True if the compensation was computed online, so that no file contains it.
    """

    data: RunData
    cell: CellConfig
    motion: AnyMotion
    file: FeedforwardFile | None
    streamed: bool = False

    @property
    def run_id(self) -> str:
        """Id of the run."""
        return self.data.folder.run_id

    def samples(self) -> MotionSamples:
        """Return the motion as it was planned, with its feedforward.

        Raises:
            DataQualityError: The run was streamed.
            ConfigError: The motion or its feedforward does not fit the robot or the cell.
        """
        if self.streamed:
            raise DataQualityError(
                f"run {self.run_id} was streamed: its feedforward was computed online and is not"
                " stored. Record the motion, with or without --feedforward, and use that run",
                code="RID-RUN-FOREIGN",
            )
        planned = self.motion.plan(self.data.robot, self.cell.cycle_time_s).whole()
        return planned if self.file is None else self.file.onto(planned)

    @property
    def use(self) -> str:
        """Phrase that states whether the feedforward was computed from runs of this same motion.

        "tuned on it", "refined N times", or "never used" if its runs were not used; "plain" without
        a feedforward; "streamed" if the compensation was computed online.
        """
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


def read_motion_run(
    folder: RunFolder, *, unfinished: bool = False, changing_load: bool = False
) -> MotionRun:
    """Read a run with its motion; the options are passed to `RunData.load`.

    Raises:
        ConfigError, DataQualityError, RecordingError: The run has no motion, or cannot be read.
        LockedError: The run is still being recorded.
    """
    data = RunData.load(folder, unfinished=unfinished, changing_load=changing_load)
    cell, motion = data.cell, folder.file(MOTION)
    if cell is None or not motion.exists():
        raise DataQualityError(
            f"run {folder.run_id} contains no commanded positions: use a run that rid-daq has"
            " recorded",
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
