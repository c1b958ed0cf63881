"""`DeadMan`: shared memory by which a held key permits the cyclic task to move the robot.

A key counts as held until a time on the clock of `safety_now_s`. Each repeat of a keyboard key and
each new message of a button extends this time. A release needs no message: the key counts as
released once the time has passed. This is also true if the program was killed or suspended, or if
the user's computer hangs.
"""

from __future__ import annotations

import ctypes
from typing import Any, Final

import numpy as np

from acquisition.hold_to_run.line import HoldLine
from acquisition.task.shared_block import SharedBlock
from config.arrays import FloatArray
from config.quantities import MOST_JOINTS

DEAD_MAN_S: Final = 0.2
"""Time for which a message about a held key is valid [s]; without a further message the motion
stops."""


class _Words(ctypes.Structure):
    """Memory layout: the program writes the first five fields, the cyclic task the last three."""

    _fields_ = (
        ("press", ctypes.c_int64),
        ("held_until_s", ctypes.c_double),
        ("finishing", ctypes.c_int64),
        ("pace_per_s", ctypes.c_double),
        ("goal", ctypes.c_double * MOST_JOINTS),
        ("begun", ctypes.c_int64),
        ("over", ctypes.c_int64),
        ("pose", ctypes.c_double * MOST_JOINTS),
    )


class DeadMan(SharedBlock):
    """Shared memory between a held key and the cyclic task.

    Each press of a key permits the motion along one straight line while the key is held. A release
    ends the press; a new press is needed to continue. `press` is written after the line that it
    announces, and `over` and `begun` after the pose.
    """

    LABEL = "rid-daq-dead-man-1"
    WORDS = _Words
    _words: Any

    def press(self, line: HoldLine, until_s: float) -> None:
        """Permit the motion along a line that begins at the robot's pose at rest.

        Args:
            line: The checked line.
            until_s: Time until which the key counts as held, on the clock of `safety_now_s` [s].
        """
        words = self._words
        words.goal[: len(line.goal)] = line.goal.tolist()
        words.pace_per_s = line.pace_per_s
        words.held_until_s = until_s
        words.press += 1

    def hold(self, until_s: float) -> None:
        """Set the time until which the key counts as held, on the clock of `safety_now_s` [s]."""
        self._words.held_until_s = until_s

    def release(self) -> None:
        """Store that the key is released."""
        self._words.held_until_s = 0.0

    def finish(self) -> None:
        """Request the end of the motion, once the robot is at rest."""
        self._words.finishing = 1

    @property
    def is_finishing(self) -> bool:
        """True if the end of the motion was requested."""
        return bool(self._words.finishing)

    @property
    def press_count(self) -> int:
        """Number of presses so far."""
        return int(self._words.press)

    @property
    def held_until_s(self) -> float:
        """Time until which the key counts as held, on the clock of `safety_now_s` [s]."""
        return float(self._words.held_until_s)

    def latest_line(self, joints: int) -> tuple[FloatArray, float]:
        """Return the latest line's goal, (joints,), and its pace, a fraction per second [1/s]."""
        return np.array(self._words.goal[:joints]), float(self._words.pace_per_s)

    def report_rest(self, pose: FloatArray, over: int) -> None:
        """Report the pose at rest and the number of ended presses; called by the cyclic task."""
        words = self._words
        words.pose[: len(pose)] = pose.tolist()
        words.over = over
        words.begun = 1

    def rest_pose(self, joints: int) -> FloatArray | None:
        """Return the pose at rest, (joints,); None before the motion and during a press."""
        words = self._words
        if not words.begun or words.over != words.press:
            return None
        return np.array(words.pose[:joints])
