"""`RecorderWords`, `MonitorWords`: shared memory written by recorder and drive monitor."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence

from acquisition.task.shared_block import SharedError, clip_text
from acquisition.task.states import MonitorState, RecorderState
from config.errors import RidDaqError
from config.quantities import MOST_JOINTS


class RecorderWords(ctypes.Structure):
    """Fields that the recorder writes."""

    _error: SharedError

    _fields_ = (("_state", ctypes.c_int64), ("_error", SharedError))

    @property
    def state(self) -> RecorderState:
        """State of the recorder."""
        return RecorderState(self._state)

    @state.setter
    def state(self, state: RecorderState) -> None:
        self._state = int(state)

    def fail(self, error: RidDaqError) -> None:
        """Report an error that ends the recorder."""
        self._error.put(error)
        self.state = RecorderState.FAILED

    def end(self, error: RidDaqError) -> None:
        """Report an error that must end the motion; the recorder continues as long as it can."""
        self._error.put(error)
        self.state = RecorderState.ENDING

    @property
    def error(self) -> RidDaqError | None:
        """Last error from `fail` or `end`; None without an error."""
        return self._error.get()


class MonitorWords(ctypes.Structure):
    """Fields that the drive monitor writes; if it dies, the program reports its failure here."""

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
        """State of the monitor."""
        return MonitorState(self._state)

    @state.setter
    def state(self, state: MonitorState) -> None:
        self._state = int(state)

    @property
    def working(self) -> bool:
        """True while the monitor starts or polls."""
        return self.state in (MonitorState.STARTING, MonitorState.POLLING)

    @property
    def rounds(self) -> int:
        """Number of requested rounds of readings that are in the file."""
        return int(self._rounds)

    def count_round(self) -> None:
        """Report that a requested round is in the file."""
        self._rounds += 1

    def show_temperatures(self, temperature_k: Sequence[float], problems: Sequence[str]) -> None:
        """Report the latest temperatures [K], and the reasons for missing ones."""
        self._temperature_k[: len(temperature_k)] = temperature_k
        self._seen = 1
        if problems:
            self._problems += len(problems)
            self._problem = clip_text(problems[-1], 1023)

    def temperatures(self, joints: int) -> tuple[float, ...]:
        """Return the latest temperatures of the joints [K]; empty before the first round."""
        return tuple(self._temperature_k[:joints]) if self._seen else ()

    def fail(self, error: RidDaqError) -> None:
        """Report an error that ends the monitor."""
        self._error.put(error)
        self.state = MonitorState.FAILED

    @property
    def note(self) -> str:
        """Description of the monitor's problems, in one sentence; empty without problems."""
        if self.state is MonitorState.FAILED:
            return f"no more temperatures are recorded: {self._error.get()}"
        if not self._problems:
            return ""
        times, last = self._problems, self._problem.decode(errors="replace")
        return f"problems while reading the drives' temperatures: {times}; last problem: {last}"
