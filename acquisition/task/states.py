"""States of the processes of a motion, and `TaskProgress`."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

from acquisition.motion.samples import Phase

if TYPE_CHECKING:
    # Not imported at run time, because importing numpy would delay `rid-daq stop`.
    from acquisition.task.joint_values import JointValues


class TaskState(IntEnum):
    """State of the cyclic task."""

    STARTING = 0
    BRING_UP = 1
    ENABLING = 2
    MOVING = 3
    STOPPING = 4
    FINISHED = 5


class RecorderState(IntEnum):
    """State of the recorder; in ENDING it still writes, and requests the end of the motion."""

    STARTING = 0
    RECORDING = 1
    FINISHED = 2
    FAILED = 3
    ENDING = 4


class MonitorState(IntEnum):
    """State of the drive monitor."""

    STARTING = 0
    POLLING = 1
    FINISHED = 2
    FAILED = 3


class Pace(IntEnum):
    """Kind of clock of the cyclic task."""

    UNKNOWN = 0
    REAL_TIME = 1
    LOCKSTEP = 2


@dataclass(frozen=True)
class TaskProgress:
    """Progress of the cyclic task, for progress bars.

    Attributes:
        state: State of the task.
        phase: Phase of the motion's row that was commanded last.
        sample_index: Row of the motion that was commanded last; -1 before and after the motion.
        cycles: Number of cycles so far.
        temperature_k: Latest motor temperatures [K]; NaN for a drive that did not answer, empty
            without a monitor or before the first answer.
        joints: Values of the latest cycles; None before the first cycle or if they were not read.
    """

    state: TaskState
    phase: Phase
    sample_index: int
    cycles: int
    temperature_k: tuple[float, ...] = ()
    joints: JointValues | None = None
