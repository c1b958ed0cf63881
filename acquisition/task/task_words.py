"""`TaskWords`: shared memory that the cyclic task writes for the other processes."""

from __future__ import annotations

import ctypes
from math import isnan, nan

from acquisition.motion.samples import Phase
from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.task.shared_block import SharedError, clip_text
from acquisition.task.states import Pace, TaskState
from config.errors import RidDaqError


class TaskWords(ctypes.Structure):
    """Fields that the cyclic task writes; a text is written before the field that announces it."""

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
        ("_rounds_requested", ctypes.c_int64),
        ("_round_requested_s", ctypes.c_double),
        ("_power_off", ctypes.c_int64),
        ("_displaced", ctypes.c_int64),
    )

    @property
    def beat(self) -> int:
        """Heartbeat counter of the task."""
        return int(self._beat)

    def count_heartbeat(self) -> None:
        """Increment the heartbeat counter while the task waits."""
        self._beat += 1

    @property
    def state(self) -> TaskState:
        """State of the task."""
        return TaskState(self._state)

    @state.setter
    def state(self, state: TaskState) -> None:
        self._state = int(state)
        self._beat += 1

    @property
    def pace(self) -> Pace:
        """Kind of clock of the task."""
        return Pace(self._pace)

    @pace.setter
    def pace(self, pace: Pace) -> None:
        self._pace = int(pace)

    def set_progress(self, sample_index: int, phase: int, cycles: int) -> None:
        """Report the row of the motion that is being commanded; counts as a heartbeat."""
        self._sample_index = sample_index
        self._phase = phase
        self._cycles = cycles
        self._beat += 1

    @property
    def sample_index(self) -> int:
        """Row of the motion that was commanded last; -1 before and after the motion."""
        return int(self._sample_index)

    @property
    def phase(self) -> Phase:
        """Phase of the row of the motion that was commanded last."""
        return Phase(self._phase)

    @property
    def cycles(self) -> int:
        """Number of cycles so far."""
        return int(self._cycles)

    def report_stop(self, reason: StopReason) -> None:
        """Report the reason of a stop; the first reason is kept."""
        if self._reason_code:
            return
        self._reason_joint = clip_text(reason.joint or "", 63)
        self._reason_text = clip_text(reason.text, 1023)
        self._reason_value = nan if reason.value is None else reason.value
        self._reason_limit = nan if reason.limit is None else reason.limit
        self._reason_code = int(reason.code)

    @property
    def stop_reason(self) -> StopReason | None:
        """Reason for which the task stopped the motion; None if it did not."""
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
        """Report that all axes rest, `ramp_s` after the quick stop [s]."""
        self._ramp_s = ramp_s
        self._at_rest = 1

    @property
    def ramp_s(self) -> float | None:
        """Time from the quick stop to rest [s]; None until rest is detected."""
        return float(self._ramp_s) if self._at_rest else None

    @property
    def displaced(self) -> bool:
        """True if the robot was not at its last known pose before the motion."""
        return bool(self._displaced)

    @displaced.setter
    def displaced(self, displaced: bool) -> None:
        self._displaced = int(displaced)

    def add_note(self, text: str) -> None:
        """Add a note for the program's report."""
        line = " ".join(text.split())
        self._notes = clip_text(f"{self._notes.decode()}{line}\n", 4095)

    @property
    def notes(self) -> tuple[str, ...]:
        """Other notes of the task, one sentence each."""
        return tuple(self._notes.decode(errors="replace").splitlines())

    def fail(self, error: RidDaqError) -> None:
        """Report an error that ends the task."""
        self._error.put(error)

    @property
    def error(self) -> RidDaqError | None:
        """Error that ended the task; None without an error."""
        return self._error.get()

    @property
    def power_off(self) -> bool:
        """True once every drive has confirmed power off; False means unknown."""
        return bool(self._power_off)

    @power_off.setter
    def power_off(self, seen: bool) -> None:
        self._power_off = int(seen)

    def request_round(self, time_s: float) -> int:
        """Request a round of the monitor for a simulated time [s]; return its number."""
        self._round_requested_s = time_s
        self._rounds_requested += 1
        return int(self._rounds_requested)

    @property
    def rounds_requested(self) -> int:
        """Number of rounds requested from the monitor, in lock-step."""
        return int(self._rounds_requested)

    @property
    def round_requested_s(self) -> float:
        """Simulated time of the latest requested round [s]."""
        return float(self._round_requested_s)
