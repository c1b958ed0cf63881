"""`TaskWords`: what the cyclic task tells the other processes of a motion."""

from __future__ import annotations

import ctypes
from math import isnan, nan

from acquisition.motion.samples import Phase
from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.task.shared_block import SharedError, clipped
from acquisition.task.states import Pace, TaskState
from config.errors import RidDaqError


class TaskWords(ctypes.Structure):
    """Written by the cyclic task; texts before the word that announces them."""

    _reason_code: int
    _error: SharedError
    _notes: bytes

    _fields_ = (
        ("_state", ctypes.c_int64),
        ("_beat", ctypes.c_int64),
        ("_cycles", ctypes.c_int64),
        ("_sample_index", ctypes.c_int64),
        ("_phase", ctypes.c_int64),
        ("_reason_code", ctypes.c_int64),
        ("_reason_value", ctypes.c_double),
        ("_reason_limit", ctypes.c_double),
        ("_reason_joint", ctypes.c_char * 64),
        ("_reason_text", ctypes.c_char * 1024),
        ("_at_rest", ctypes.c_int64),
        ("_ramp_s", ctypes.c_double),
        ("_error", SharedError),
        ("_notes", ctypes.c_char * 4096),
        ("_pace", ctypes.c_int64),
        ("_rounds_asked", ctypes.c_int64),
        ("_round_asked_s", ctypes.c_double),
        ("_power_off", ctypes.c_int64),
        ("_displaced", ctypes.c_int64),
    )

    @property
    def beat(self) -> int:
        """A counter that grows while the task lives."""
        return int(self._beat)

    def give_sign_of_life(self) -> None:
        """Count the beat on: the task waits."""
        self._beat += 1

    @property
    def state(self) -> TaskState:
        """How far the task has come."""
        return TaskState(self._state)

    @state.setter
    def state(self, state: TaskState) -> None:
        self._state = int(state)
        self._beat += 1

    @property
    def pace(self) -> Pace:
        """By which clock the task runs."""
        return Pace(self._pace)

    @pace.setter
    def pace(self, pace: Pace) -> None:
        self._pace = int(pace)

    def set_progress(self, sample_index: int, phase: int, cycles: int) -> None:
        """Say which row of the motion is being commanded; a sign of life."""
        self._sample_index = sample_index
        self._phase = phase
        self._cycles = cycles
        self._beat += 1

    @property
    def sample_index(self) -> int:
        """The row of the motion last commanded; -1 before and after it."""
        return int(self._sample_index)

    @property
    def phase(self) -> Phase:
        """That row's phase."""
        return Phase(self._phase)

    @property
    def cycles(self) -> int:
        """How many cycles there were."""
        return int(self._cycles)

    def report_stop(self, reason: StopReason) -> None:
        """Say why the motion is being stopped; the first reason stays."""
        if self._reason_code:
            return
        self._reason_joint = clipped(reason.joint or "", 63)
        self._reason_text = clipped(reason.text, 1023)
        self._reason_value = nan if reason.value is None else reason.value
        self._reason_limit = nan if reason.limit is None else reason.limit
        self._reason_code = int(reason.code)

    @property
    def stop_reason(self) -> StopReason | None:
        """Why the task stopped the motion; None where it did not."""
        if not self._reason_code:
            return None
        value, limit = self._reason_value, self._reason_limit
        return StopReason(
            code=StopCode(self._reason_code),
            text=self._reason_text.decode(errors="replace"),
            joint=self._reason_joint.decode(errors="replace") or None,
            value=None if isnan(value) else value,
            limit=None if isnan(limit) else limit,
        )

    def report_rest(self, ramp_s: float) -> None:
        """Say that all axes rest, so long after the quick stop [s]."""
        self._ramp_s = ramp_s
        self._at_rest = 1

    @property
    def ramp_s(self) -> float | None:
        """How long the axes took to come to rest [s], None as long as that was not seen."""
        return float(self._ramp_s) if self._at_rest else None

    @property
    def displaced(self) -> bool:
        """Whether the robot stood elsewhere than it was seen last, before the motion."""
        return bool(self._displaced)

    @displaced.setter
    def displaced(self, displaced: bool) -> None:
        self._displaced = int(displaced)

    def add_note(self, text: str) -> None:
        """Keep one more sentence for the program's report."""
        line = " ".join(text.split())
        self._notes = clipped(f"{self._notes.decode()}{line}\n", 4095)

    @property
    def notes(self) -> tuple[str, ...]:
        """What else the task has to say, one sentence each."""
        return tuple(self._notes.decode(errors="replace").splitlines())

    def fail(self, error: RidDaqError) -> None:
        """Hand an error that ends the task to the program."""
        self._error.put(error)

    @property
    def error(self) -> RidDaqError | None:
        """The error that ended the task; None where none did."""
        return self._error.get()

    @property
    def power_off(self) -> bool:
        """Whether the drives were seen without power at the end; nobody knows as long as not."""
        return bool(self._power_off)

    @power_off.setter
    def power_off(self, seen: bool) -> None:
        self._power_off = int(seen)

    def ask_round(self, time_s: float) -> int:
        """Ask the monitor for a round that counts for a simulated time [s]; return its number."""
        self._round_asked_s = time_s
        self._rounds_asked += 1
        return int(self._rounds_asked)

    @property
    def rounds_asked(self) -> int:
        """How many rounds the monitor has been asked for, in lock-step."""
        return int(self._rounds_asked)

    @property
    def round_asked_s(self) -> float:
        """The simulated time of the latest of them [s]."""
        return float(self._round_asked_s)
