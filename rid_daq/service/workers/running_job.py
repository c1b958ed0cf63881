"""`RunningJob`: a worker process, the events of its job, and its present motion."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from acquisition.supervision.stop_reason import StopCode
from acquisition.task.control_block import ControlBlock
from acquisition.task.ring import Ring
from rid_daq.blocks.block import Verdict
from rid_daq.live.base_wrench import LiveWrench
from rid_daq.live.picture import MotionPicture, ShownMotion
from rid_daq.service.records import CellState, Job
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.signals.signal_bins import SignalBins
from rid_daq.service.signals.signal_reader import SignalReader
from rid_daq.service.workers.worker_process import WorkerProcess
from rid_daq.terminal.job_events import (
    EVENT,
    AnswerEvent,
    AnyEvent,
    EndEvent,
    EventBlock,
    MotionEvent,
    QuestionEvent,
    ResultEvent,
    VerdictEvent,
)

AT_REST: Final = "the drives are read without power"

MOST_WAITING_BYTES: Final = 1 << 15
"""Limit of unread bytes in a worker's input; above it, messages about held keys are dropped."""


class EventTail:
    """Reads new events from the event file of a job.

    Args:
        path: The event file.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._offset = 0
        self._rest = b""

    def read_new(self) -> Sequence[AnyEvent]:
        """Return the events that were written since the last call."""
        try:
            with self._path.open("rb") as file:
                file.seek(self._offset)
                data = file.read()
        except FileNotFoundError:
            return []
        self._offset += len(data)
        *lines, self._rest = (self._rest + data).split(b"\n")
        events = []
        for line in lines:
            with contextlib.suppress(ValidationError):  # an incomplete line of a killed worker
                events.append(EVENT.validate_json(line))
        return events


class RunningJob:
    """A running job.

    Args:
        job: The job as it is saved.
        events: Event file of the job.

    Attributes:
        job: The job as it was saved last.
        stopping: Reason of the stop request; empty without a stop request.
        question: Question of the job that waits for an answer.
        ended: Last event of the job.
        events_read: Number of events that were read.
    """

    def __init__(self, job: Job, cell: ServedCell, worker: WorkerProcess, events: Path) -> None:
        self.job = job
        self.cell = cell
        self.process = worker
        self.stopping = ""
        self.question: QuestionEvent | None = None
        self.ended: EndEvent | None = None
        self.document: dict[str, object] | None = None
        self.run: str | None = None
        self.last_bad = ""
        self.events_read = 0
        self._tail = EventTail(events)
        self._stop_code: StopCode | None = None
        self._motion: MotionEvent | None = None
        self._control: ControlBlock | None = None
        self._ring: Ring | None = None
        self._picture: MotionPicture | None = None
        self._signals: SignalReader | None = None
        plate = cell.loaded.config.plate
        self._wrench = None if plate is None else LiveWrench(plate, worker.pid)

    def read_events(self) -> Sequence[AnyEvent]:
        """Return the new events of the job, and update the job's state from them."""
        new = self._tail.read_new()
        self.events_read += len(new)
        for event in new:
            match event:
                case MotionEvent():
                    self._motion, self._picture, self.run = event, None, event.run
                case QuestionEvent():
                    self.question = event
                case AnswerEvent():
                    self.question = None
                case ResultEvent():
                    self.document = event.document
                    self.last_bad = _failed_verdict(event.blocks) or self.last_bad
                case VerdictEvent(passed=False):
                    self.last_bad = event.text
                case EndEvent():
                    self.ended = event
        return new

    @property
    def is_over(self) -> bool:
        """True if the worker process has ended."""
        return self.process.returncode is not None

    def stop(self, why: str, code: StopCode) -> None:
        """Stop the job: a motion through the control block, any other job by SIGTERM."""
        self.stopping = self.stopping or why
        self._stop_code = self._stop_code or code
        control = self._find_control()
        if control is not None:
            control.program.request_stop(code)
        if control is None or control.task_gone:  # the task no longer reads the control block
            self.process.terminate()

    def repeat_stop(self) -> None:
        """Repeat the stop request for a motion that began after it; do nothing without a motion."""
        if self._stop_code is not None and (control := self._find_control()) is not None:
            control.program.request_stop(self._stop_code)

    def send_order(self, **order: Any) -> None:
        """Send an order to the worker; do nothing if it has ended."""
        writer = self.process.stdin
        if not writer.is_closing():
            writer.write((json.dumps(order) + "\n").encode())

    def send_order_if_writable(self, **order: Any) -> None:
        """Send an order; drop it if too many orders wait, because it would arrive too late."""
        writer = self.process.stdin
        if writer.transport.get_write_buffer_size() < MOST_WAITING_BYTES:
            self.send_order(**order)

    @property
    def cell_state(self) -> CellState:
        """State of the cell whose bus the job uses."""
        if not self.job.kind.operation.moves:
            return CellState.CHECKING
        if self.stopping:
            return CellState.STOPPING
        if self._find_control() is not None or self.wants_key:
            return CellState.MOVING
        return CellState.AT_REST if self.question is None else CellState.WAITING

    @property
    def wants_key(self) -> bool:
        """True if the job requires a held key now."""
        return self.question is not None and self.question.form == "hold" and not self.is_over

    def newest_picture(self) -> dict[str, object] | None:
        """Return the newest values of the drives for the page.

        None before a motion, or if the job does not read the drives in every cycle. At rest, the
        picture has no title, and its progress means nothing.
        """
        if not self._observe() or self._ring is None or self._control is None:
            return None
        motion = self._motion
        if self._picture is None:
            loaded = self.cell.loaded
            title, rows, of_period = "", 0, None
            if motion is not None:
                title, rows, of_period = motion.title, motion.rows, motion.rows_per_period
            shown = ShownMotion(title, rows, of_period, loaded.config, loaded.robot)
            self._picture = MotionPicture(shown, self._ring, self._control)
        found: dict[str, object] = json.loads(self._picture.document())
        if self._wrench is not None:
            found["base_wrench"] = self._wrench.document()
        return found if motion is not None else {**found, "words": AT_REST}

    def read_signals(self) -> Sequence[tuple[tuple[str, ...], SignalBins]]:
        """Return the new bins of the live signals, each time with the names of the joints."""
        before = self._signals
        if not self._observe():
            self._signals = None
        found = []
        if before is not None and self._signals is not before:
            found.append((before.joints, before.finish()))
        if self._signals is not None:
            found.append((self._signals.joints, self._signals.read()))
        return found

    def _observe(self) -> bool:
        """Observe the memory of the present motion, or of drives that are watched at rest.

        Returns:
            False if there is no such memory.

        Raises:
            RecordingError: The cell's joints have changed since the start; raised once per motion.
        """
        has_rows = self._motion is not None or self.job.kind == "watch"
        control = self._find_control() if has_rows else None
        if control is None:
            return False
        if control is not self._control:
            ring = Ring.of_process(self.process.pid)
            if ring is None:
                return False
            self._control, self._ring = control, ring
            self._picture = self._signals = None
            loaded = self.cell.loaded
            joints, cycle_time_s = loaded.robot.joint_names, loaded.config.cycle_time_s
            self._signals = SignalReader(ring, control, joints, cycle_time_s)
        return True

    def _find_control(self) -> ControlBlock | None:
        """Return the control block of the present motion, None without a motion."""
        if self.is_over:
            return None
        if self._control is None or self._control.task_gone:
            try:
                return ControlBlock.of_process(self.process.pid)
            except OSError:  # the process has just ended
                return None
        return self._control


def _failed_verdict(blocks: Iterable[EventBlock]) -> str:
    """Return the text of the first failed verdict, without "Failed"; empty if all passed."""
    failed = (each for each in blocks if isinstance(each, Verdict) and each.passed is False)
    return next((each.text.removeprefix("Failed: ") for each in failed), "")


@dataclass
class StartingJob:
    """A job whose worker is being started.

    Attributes:
        job: The job as it is saved.
        stopping: Reason of the stop request; empty without a stop request.
    """

    job: Job
    stopping: str = ""

    def stop(self, why: str, _code: StopCode) -> None:
        """Prevent the start of the job."""
        self.stopping = self.stopping or why
