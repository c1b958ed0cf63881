"""`ControlBlock`: what the program, the cyclic task, the recorder and the monitor tell one another.

A few words of anonymous shared memory. Every field has one writer, but for the request to stop,
which anybody may make; texts are written before the word that announces them.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from math import isnan, nan
from typing import Any

from acquisition.motion.samples import Phase
from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.task.shared_memory import SharedMemory
from acquisition.task.states import MonitorState as MonitorState
from acquisition.task.states import Pace as Pace
from acquisition.task.states import Progress as Progress
from acquisition.task.states import RecorderState as RecorderState
from acquisition.task.states import TaskState as TaskState
from config import errors
from config.errors import DriverError, RidDaqError

MOST_JOINTS = 16
MEMORY_NAME = "rid-daq-control-1"
"""Says what is in the memory, and in which layout: count it up where that changes."""


class _Fields(ctypes.Structure):
    _fields_ = (
        # written by the program; the first also by the live page and by `rid-daq stop`
        ("stop_code", ctypes.c_int64),
        ("task_gone", ctypes.c_int64),
        ("judging", ctypes.c_int64),
        ("periods_judged", ctypes.c_int64),
        ("enough", ctypes.c_int64),
        ("monitored", ctypes.c_int64),
        # written by the cyclic task
        ("task_state", ctypes.c_int64),
        ("task_beat", ctypes.c_int64),
        ("cycles", ctypes.c_int64),
        ("sample_index", ctypes.c_int64),
        ("phase", ctypes.c_int64),
        ("reason_code", ctypes.c_int64),
        ("reason_value", ctypes.c_double),
        ("reason_limit", ctypes.c_double),
        ("reason_joint", ctypes.c_char * 64),
        ("reason_text", ctypes.c_char * 1024),
        ("at_rest", ctypes.c_int64),
        ("ramp_s", ctypes.c_double),
        ("task_failed", ctypes.c_int64),
        ("error_class", ctypes.c_char * 64),
        ("error_text", ctypes.c_char * 4096),
        ("notes", ctypes.c_char * 4096),
        ("pace", ctypes.c_int64),
        ("monitor_asked", ctypes.c_int64),
        ("monitor_asked_s", ctypes.c_double),
        # written by the recorder
        ("recorder_state", ctypes.c_int64),
        ("recorder_beat", ctypes.c_int64),
        ("recorder_error", ctypes.c_char * 1024),
        # written by the drive monitor
        ("monitor_state", ctypes.c_int64),
        ("monitor_rounds", ctypes.c_int64),
        ("monitor_seen", ctypes.c_int64),
        ("monitor_problems", ctypes.c_int64),
        ("temperature_k", ctypes.c_double * MOST_JOINTS),
        ("monitor_error", ctypes.c_char * 1024),
    )


class ControlBlock:
    """The shared words; made by `create`, handed to the processes as an argument."""

    def __init__(self, memory: SharedMemory) -> None:
        self._memory = memory
        self._fields = _Fields.from_buffer(memory.buffer)

    @classmethod
    def create(cls) -> ControlBlock:
        """Return a cleared block in fresh shared memory."""
        block = cls(SharedMemory.create(MEMORY_NAME, ctypes.sizeof(_Fields)))
        block.set_progress(-1, Phase.APPROACH, 0)
        return block

    @classmethod
    def of_process(cls, pid: int) -> ControlBlock | None:
        """Return the block of the motion that another process has under way, None without one.

        Raises
        ------
        PermissionError
            The process is not this user's.
        """
        for memory in SharedMemory.of_process(pid, MEMORY_NAME, ctypes.sizeof(_Fields)):
            block = cls(memory)
            if block.task_state is not TaskState.FINISHED and not block.task_gone:
                return block
        return None

    def __reduce__(self) -> tuple[Callable[..., ControlBlock], tuple[Any]]:
        return ControlBlock, (self._memory,)

    # the program's side

    def request_stop(self, code: StopCode) -> None:
        """Ask the task to stop; the first request counts. Safe in a signal handler."""
        if not self._fields.stop_code:
            self._fields.stop_code = int(code)

    def declare_task_gone(self) -> None:
        """Tell the recorder that no more rows will come."""
        self._fields.task_gone = 1

    def judge_periods(self) -> None:
        """Announce, before the motion, that each period will be judged (`judge`)."""
        self._fields.judging = 1

    def judge(self, periods: int, enough: bool) -> None:
        """Say that so many periods have been judged, and whether they are enough."""
        self._fields.enough = int(enough)
        self._fields.periods_judged = periods

    @property
    def progress(self) -> Progress:
        """Where the task is."""
        fields = self._fields
        return Progress(
            state=TaskState(fields.task_state),
            phase=Phase(fields.phase),
            sample_index=int(fields.sample_index),
            cycles=int(fields.cycles),
            temperature_k=self._temperatures,
        )

    @property
    def _temperatures(self) -> tuple[float, ...]:
        fields = self._fields
        return tuple(fields.temperature_k[: fields.monitored]) if fields.monitor_seen else ()

    def announce_monitor(self, joints: int) -> None:
        """Say, before the motion, that the drives of so many joints are asked for temperatures."""
        self._fields.monitored = joints

    def declare_monitor_dead(self) -> None:
        """Let nobody wait for a monitor whose process has ended without a word."""
        if self.monitor_state in (MonitorState.STARTING, MonitorState.POLLING):
            self.fail_monitor("the process that asks the drives has died")

    @property
    def stop_reason(self) -> StopReason | None:
        """Why the task stopped the motion; None where it did not."""
        fields = self._fields
        if not fields.reason_code:
            return None
        value, limit = fields.reason_value, fields.reason_limit
        return StopReason(
            code=StopCode(fields.reason_code),
            text=fields.reason_text.decode(errors="replace"),
            joint=fields.reason_joint.decode(errors="replace") or None,
            value=None if isnan(value) else value,
            limit=None if isnan(limit) else limit,
        )

    @property
    def ramp_s(self) -> float | None:
        """How long the axes took to come to rest [s], None as long as that was not seen."""
        return float(self._fields.ramp_s) if self._fields.at_rest else None

    @property
    def task_error(self) -> RidDaqError | None:
        """The error that ended the task; None where none did."""
        fields = self._fields
        if not fields.task_failed:
            return None
        kind = getattr(errors, fields.error_class.decode(), DriverError)
        if not (isinstance(kind, type) and issubclass(kind, RidDaqError)):
            kind = DriverError
        return kind(fields.error_text.decode(errors="replace"))

    @property
    def notes(self) -> tuple[str, ...]:
        """What else the task has to say, one sentence each."""
        return tuple(self._fields.notes.decode(errors="replace").splitlines())

    # the task's side

    @property
    def stop_code(self) -> int:
        """`StopCode` of the program's request to stop, 0 where there is none."""
        return int(self._fields.stop_code)

    @property
    def judging(self) -> bool:
        """Whether the program judges each period."""
        return bool(self._fields.judging)

    @property
    def periods_judged(self) -> int:
        """How many periods the program has judged."""
        return int(self._fields.periods_judged)

    @property
    def enough(self) -> bool:
        """Whether the program has seen enough periods."""
        return bool(self._fields.enough)

    @property
    def monitored(self) -> int:
        """Of how many joints the drives are asked for temperatures; 0: of none."""
        return int(self._fields.monitored)

    @property
    def pace(self) -> Pace:
        """By which clock the task runs."""
        return Pace(self._fields.pace)

    @pace.setter
    def pace(self, pace: Pace) -> None:
        self._fields.pace = int(pace)

    def ask_monitor(self, time_s: float) -> int:
        """Ask the monitor for a round that counts for a simulated time [s]; return its number."""
        self._fields.monitor_asked_s = time_s
        self._fields.monitor_asked += 1
        return int(self._fields.monitor_asked)

    @property
    def task_beat(self) -> int:
        """A counter that grows while the task lives."""
        return int(self._fields.task_beat)

    @property
    def task_state(self) -> TaskState:
        """How far the task has come."""
        return TaskState(self._fields.task_state)

    @task_state.setter
    def task_state(self, state: TaskState) -> None:
        self._fields.task_state = int(state)
        self._fields.task_beat += 1

    def set_progress(self, sample_index: int, phase: int, cycles: int) -> None:
        """Say which row of the motion is being commanded; a sign of life."""
        fields = self._fields
        fields.sample_index = sample_index
        fields.phase = phase
        fields.cycles = cycles
        fields.task_beat += 1

    def beat_task(self) -> None:
        """Give a sign of life of a task that waits."""
        self._fields.task_beat += 1

    def report_stop(self, reason: StopReason) -> None:
        """Say why the motion is being stopped; the first reason stays."""
        fields = self._fields
        if fields.reason_code:
            return
        fields.reason_joint = _clipped(reason.joint or "", 63)
        fields.reason_text = _clipped(reason.text, 1023)
        fields.reason_value = nan if reason.value is None else reason.value
        fields.reason_limit = nan if reason.limit is None else reason.limit
        fields.reason_code = int(reason.code)

    def report_rest(self, ramp_s: float) -> None:
        """Say that all axes rest, so long after the quick stop [s]."""
        self._fields.ramp_s = ramp_s
        self._fields.at_rest = 1

    def add_note(self, text: str) -> None:
        """Keep one more sentence for the program's report."""
        line = " ".join(text.split())
        self._fields.notes = _clipped(f"{self._fields.notes.decode()}{line}\n", 4095)

    def report_error(self, error: RidDaqError) -> None:
        """Hand an error that ends the task to the program."""
        fields = self._fields
        fields.error_class = _clipped(type(error).__name__, 63)
        fields.error_text = _clipped(str(error), 4095)
        fields.task_failed = 1

    # the recorder's side

    @property
    def task_gone(self) -> bool:
        """Whether the task has ended, by its own word or the program's."""
        return bool(self._fields.task_gone) or self._fields.task_state == TaskState.FINISHED

    @property
    def recorder_state(self) -> RecorderState:
        """How far the recorder has come."""
        return RecorderState(self._fields.recorder_state)

    @recorder_state.setter
    def recorder_state(self, state: RecorderState) -> None:
        self._fields.recorder_state = int(state)

    @property
    def recorder_beat(self) -> int:
        """A counter that grows while the recorder lives."""
        return int(self._fields.recorder_beat)

    def beat_recorder(self) -> None:
        """Give a sign of life of the recorder."""
        self._fields.recorder_beat += 1

    @property
    def recorder_error(self) -> str:
        """Why the recorder failed; empty where it did not."""
        return str(self._fields.recorder_error.decode(errors="replace"))

    def fail_recorder(self, text: str) -> None:
        """Say that the recorder cannot go on."""
        self._fields.recorder_error = _clipped(text, 1023)
        self.recorder_state = RecorderState.FAILED

    def end_recorder(self, text: str) -> None:
        """Say why the motion must end; its end is still recorded, as far as it can be."""
        self._fields.recorder_error = _clipped(text, 1023)
        self.recorder_state = RecorderState.ENDING

    # the drive monitor's side

    @property
    def monitor_asked(self) -> int:
        """How many rounds the task has asked for, in lock-step."""
        return int(self._fields.monitor_asked)

    @property
    def monitor_asked_s(self) -> float:
        """The simulated time of the latest of them [s]."""
        return float(self._fields.monitor_asked_s)

    @property
    def monitor_rounds(self) -> int:
        """How many of them have been answered."""
        return int(self._fields.monitor_rounds)

    def count_monitor_round(self) -> None:
        """Say that a round is in the file."""
        self._fields.monitor_rounds += 1

    @property
    def monitor_state(self) -> MonitorState:
        """How far the monitor has come."""
        return MonitorState(self._fields.monitor_state)

    @monitor_state.setter
    def monitor_state(self, state: MonitorState) -> None:
        self._fields.monitor_state = int(state)

    @property
    def monitor_error(self) -> str:
        """What went wrong, in a sentence; empty where all is well."""
        text = str(self._fields.monitor_error.decode(errors="replace"))
        problems = int(self._fields.monitor_problems)
        if self.monitor_state is MonitorState.FAILED or not problems:
            return text
        return f"drives did not tell their temperature {problems} times; the last time: {text}"

    def show_temperatures(self, temperature_k: Sequence[float], problems: Sequence[str]) -> None:
        """Show the latest temperatures [K], and why some are missing."""
        fields = self._fields
        fields.temperature_k[: len(temperature_k)] = temperature_k
        fields.monitor_seen = 1
        if problems:
            fields.monitor_problems += len(problems)
            fields.monitor_error = _clipped(problems[-1], 1023)

    def fail_monitor(self, text: str) -> None:
        """Say that the monitor cannot go on."""
        self._fields.monitor_error = _clipped(text, 1023)
        self.monitor_state = MonitorState.FAILED


def _clipped(text: str, size: int) -> bytes:
    return text.encode().replace(b"\0", b"?")[:size].decode(errors="ignore").encode()
