"""`DeadMan`: what whoever holds a key tells the cyclic task, which asks in every cycle.

A key is held until a moment, by `safety_now_s`: each repeat of a keyboard, each fresh message of a
button, moves that moment on. Nobody has to say that it was released: it is, once the moment has
passed, also if the program was killed or suspended, or its computer hangs.
"""

from __future__ import annotations

import ctypes
from typing import Any, Final

import numpy as np

from acquisition.hold_to_run.line import HoldLine
from acquisition.task.helper_words import MOST_JOINTS
from acquisition.task.shared_block import SharedBlock
from config.arrays import FloatArray

DEAD_MAN_S: Final = 0.2
"""For how long one sign of a held key counts [s]: the motion goes on no longer without another."""


class _Words(ctypes.Structure):
    """The upper half is written by the program, the lower by the cyclic task."""

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

    One press is one line that the robot may go along while the key is held. Once it was released,
    the press is over: going on takes another. What a word announces is written before it.
    """

    LABEL = "rid-daq-dead-man-1"
    WORDS = _Words
    _words: Any

    def press(self, line: HoldLine, until_s: float) -> None:
        """Begin a press: hold to go along a line, which begins where the robot rests.

        Args:
            line: Checked.
            until_s: Until when the key is held as far as is known, by `safety_now_s` [s].
        """
        words = self._words
        words.goal[: len(line.goal)] = line.goal.tolist()
        words.pace_per_s = line.pace_per_s
        words.held_until_s = until_s
        words.press += 1

    def hold(self, until_s: float) -> None:
        """Say that the key is held until a moment, by `safety_now_s` [s]."""
        self._words.held_until_s = until_s

    def release(self) -> None:
        """Say that the key is held no more."""
        self._words.held_until_s = 0.0

    def finish(self) -> None:
        """Ask the task to end the motion, once the robot rests."""
        self._words.finishing = 1

    @property
    def finishing(self) -> bool:
        """Whether the motion is to end."""
        return bool(self._words.finishing)

    @property
    def number(self) -> int:
        """How many presses there were."""
        return int(self._words.press)

    @property
    def held_until_s(self) -> float:
        """Until when the key is held [s]."""
        return float(self._words.held_until_s)

    def ordered(self, joints: int) -> tuple[FloatArray, float]:
        """Return where the latest press leads to, (joints,), and its pace [1/s]."""
        return np.array(self._words.goal[:joints]), float(self._words.pace_per_s)

    def rest(self, pose: FloatArray, over: int) -> None:
        """Say, as the task, that the robot is held at rest in a pose after so many presses."""
        words = self._words
        words.pose[: len(pose)] = pose.tolist()
        words.over = over
        words.begun = 1

    def resting(self, joints: int) -> FloatArray | None:
        """Return where the robot is held at rest, None before the motion and during a press."""
        words = self._words
        if not words.begun or words.over != words.press:
            return None
        return np.array(words.pose[:joints])
