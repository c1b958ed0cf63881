"""`TaskState`, `TaskProgress` and their like: how far the processes of a motion have come."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

from acquisition.motion.samples import Phase

if TYPE_CHECKING:
    from acquisition.task.joint_values import JointValues  # `rid-daq stop` does not wait for numpy


class TaskState(IntEnum):
    """How far the cyclic task has come."""

    STARTING = 0
    BRING_UP = 1
    ENABLING = 2
    MOVING = 3
    STOPPING = 4
    FINISHED = 5


class RecorderState(IntEnum):
    """How far the recorder has come; ENDING still writes, and wants the motion to end."""

    STARTING = 0
    RECORDING = 1
    FINISHED = 2
    FAILED = 3
    ENDING = 4


class MonitorState(IntEnum):
    """How far the drive monitor has come."""

    STARTING = 0
    POLLING = 1
    FINISHED = 2
    FAILED = 3


class Pace(IntEnum):
    """By which clock the cyclic task runs, as far as is known."""

    UNKNOWN = 0
    REAL_TIME = 1
    LOCKSTEP = 2


@dataclass(frozen=True)
class TaskProgress:
    """Where the cyclic task is: for a progress bar.

    `sample_index` is the row of the motion last commanded, -1 before and after it;
    `temperature_k` are the motors' latest temperatures, NaN for a drive that did not answer, empty
    where nothing asks for them or nothing has been answered yet; `joints` is what the latest cycles
    measured, None where there were none or nobody looked.
    """

    state: TaskState
    phase: Phase
    sample_index: int
    cycles: int
    temperature_k: tuple[float, ...] = ()
    joints: JointValues | None = None
