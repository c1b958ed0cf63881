"""`RecorderWords`, `MonitorWords`: what those who help the cyclic task tell the others."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence

from acquisition.task.shared_block import SharedError, clipped
from acquisition.task.states import MonitorState, RecorderState
from config.errors import RidDaqError

MOST_JOINTS = 16


class RecorderWords(ctypes.Structure):
    """Written by the recorder."""

    _error: SharedError

    _fields_ = (("_state", ctypes.c_int64), ("_error", SharedError))

    @property
    def state(self) -> RecorderState:
        """How far the recorder has come."""
        return RecorderState(self._state)

    @state.setter
    def state(self, state: RecorderState) -> None:
        self._state = int(state)

    def fail(self, error: RidDaqError) -> None:
        """Say why the recorder cannot go on."""
        self._error.put(error)
        self.state = RecorderState.FAILED

    def end(self, error: RidDaqError) -> None:
        """Say why the motion must end; its end is still recorded, as far as it can be."""
        self._error.put(error)
        self.state = RecorderState.ENDING

    @property
    def error(self) -> RidDaqError | None:
        """What `fail` or `end` said last; None where there was nothing."""
        return self._error.get()


class MonitorWords(ctypes.Structure):
    """Written by the drive monitor; its failure also by the program where it died."""

    _fields_ = (
        ("_state", ctypes.c_int64),
        ("_rounds", ctypes.c_int64),
        ("_seen", ctypes.c_int64),
        ("_problems", ctypes.c_int64),
        ("_problem", ctypes.c_char * 1024),
        ("_error", SharedError),
        ("_temperature_k", ctypes.c_double * MOST_JOINTS),
    )

    @property
    def state(self) -> MonitorState:
        """How far the monitor has come."""
        return MonitorState(self._state)

    @state.setter
    def state(self, state: MonitorState) -> None:
        self._state = int(state)

    @property
    def working(self) -> bool:
        """Whether it is about to ask, or asking."""
        return self.state in (MonitorState.STARTING, MonitorState.POLLING)

    @property
    def rounds(self) -> int:
        """How many of the rounds that the task asked for are in the file."""
        return int(self._rounds)

    def count_round(self) -> None:
        """Say that a round is in the file."""
        self._rounds += 1

    def show_temperatures(self, temperature_k: Sequence[float], problems: Sequence[str]) -> None:
        """Show the latest temperatures [K], and why some are missing."""
        self._temperature_k[: len(temperature_k)] = temperature_k
        self._seen = 1
        if problems:
            self._problems += len(problems)
            self._problem = clipped(problems[-1], 1023)

    def temperatures(self, joints: int) -> tuple[float, ...]:
        """Return the latest temperatures of so many joints [K]; none before the first round."""
        return tuple(self._temperature_k[:joints]) if self._seen else ()

    def fail(self, error: RidDaqError) -> None:
        """Say why the monitor cannot go on."""
        self._error.put(error)
        self.state = MonitorState.FAILED

    @property
    def note(self) -> str:
        """What went wrong, in a sentence; empty where all is well."""
        if self.state is MonitorState.FAILED:
            return f"no temperatures from here on: {self._error.get()}"
        if not self._problems:
            return ""
        times, last = self._problems, self._problem.decode(errors="replace")
        return f"drives did not tell their temperature {times} times; the last time: {last}"
