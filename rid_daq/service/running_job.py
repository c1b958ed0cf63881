"""`RunningJob`: a worker process, what it says, and the motion that it has under way."""

from __future__ import annotations

import asyncio
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
from acquisition.task.service_beat import ServiceBeat
from config.process.own_process import own_python
from rid_daq.blocks.block import Verdict
from rid_daq.live.picture import MotionPicture, ShownMotion
from rid_daq.service.records import Job
from rid_daq.service.served_cell import ServedCell
from rid_daq.terminal.job_events import (
    EVENT,
    Answered,
    AnyEvent,
    Asked,
    Ended,
    Judged,
    MotionBegun,
    Resulted,
    ToldBlock,
)

MOST_WAITING_BYTES: Final = 1 << 15
"""Orders that may wait for a worker that does not read, before keys are dropped [bytes]."""


class EventTail:
    """Reads the events of a job as they are written.

    Args:
        path: The file of the events.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._offset = 0
        self._rest = b""

    def new(self) -> Sequence[AnyEvent]:
        """Return what has been said since the last look."""
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
            with contextlib.suppress(ValidationError):  # a line that a killed worker has torn
                events.append(EVENT.validate_json(line))
        return events


@dataclass(frozen=True)
class WorkerProcess:
    """A worker, and the memory in which it sees that the service lives.

    Attributes:
        process: The worker.
        beat: The memory.
    """

    process: asyncio.subprocess.Process
    beat: ServiceBeat


class RunningJob:
    """A job that runs.

    Args:
        job: As it is journalled.
        events: The file of its events.

    Attributes:
        job: As it is journalled last.
        beat: Where its worker sees that the service lives.
        stopping: Why it was told to stop; empty where it was not.
        question: What waits for an answer.
        ended: Its own last word.
    """

    def __init__(self, job: Job, cell: ServedCell, worker: WorkerProcess, events: Path) -> None:
        self.job = job
        self.cell = cell
        self.process = worker.process
        self.beat = worker.beat
        self.stopping = ""
        self.question: Asked | None = None
        self.ended: Ended | None = None
        self.document: dict[str, object] | None = None
        self.run: str | None = None
        self.last_bad = ""
        self._tail = EventTail(events)
        self._stop_code: StopCode | None = None
        self._motion: MotionBegun | None = None
        self._control: ControlBlock | None = None
        self._picture: MotionPicture | None = None

    def look(self) -> Sequence[AnyEvent]:
        """Return what it has said since the last look, and remember what counts."""
        new = self._tail.new()
        for event in new:
            match event:
                case MotionBegun():
                    self._motion, self._picture, self.run = event, None, event.run
                case Asked():
                    self.question = event
                case Answered():
                    self.question = None
                case Resulted():
                    self.document = event.document
                    self.last_bad = _failed_verdict(event.blocks) or self.last_bad
                case Judged(passed=False):
                    self.last_bad = event.text
                case Ended():
                    self.ended = event
        return new

    @property
    def is_over(self) -> bool:
        """Whether its process has ended."""
        return self.process.returncode is not None

    def stop(self, why: str, code: StopCode) -> None:
        """Have it end: a motion by the word in shared memory, anything else by SIGTERM."""
        self.stopping = self.stopping or why
        self._stop_code = self._stop_code or code
        control = self._find_control()
        if control is not None:
            control.program.request_stop(code)
        if control is None or control.task_gone:  # which may read that word no more
            with contextlib.suppress(ProcessLookupError):
                self.process.terminate()

    def insist(self) -> None:
        """Tell a motion that it began although it was told to stop; nothing where none is."""
        if self._stop_code is not None and (control := self._find_control()) is not None:
            control.program.request_stop(self._stop_code)

    def order(self, **order: Any) -> None:
        """Tell its worker something; nothing where it has ended."""
        writer = self.process.stdin
        if writer is not None and not writer.is_closing():
            writer.write((json.dumps(order) + "\n").encode())

    def order_soon(self, **order: Any) -> None:
        """Tell its worker something that is worth nothing later, unless much waits already."""
        writer = self.process.stdin
        if writer is not None and writer.transport.get_write_buffer_size() < MOST_WAITING_BYTES:
            self.order(**order)

    @property
    def wants_key(self) -> bool:
        """Whether it wants a key to be held now."""
        return self.question is not None and self.question.form == "hold" and not self.is_over

    def samples(self) -> dict[str, object] | None:
        """Return the newest picture of the motion under way, None where none is."""
        if self._motion is None or self.is_over:
            return None
        control = self._find_control()
        if control is None:
            return None
        if self._picture is None or control is not self._control:
            ring = Ring.of_process(self.process.pid)
            if ring is None:
                return None
            loaded = self.cell.loaded
            shown = ShownMotion(
                self._motion.title,
                self._motion.rows,
                self._motion.rows_per_period,
                loaded.config,
                loaded.robot,
            )
            self._control, self._picture = control, MotionPicture(shown, ring, control)
        found: dict[str, object] = json.loads(self._picture.document())
        return found

    def _find_control(self) -> ControlBlock | None:
        """Return the control block of the motion under way, None where none is."""
        if self.is_over:
            return None
        if self._control is None or self._control.task_gone:
            try:
                return ControlBlock.of_process(self.process.pid)
            except OSError:  # it has just ended
                return None
        return self._control


def _failed_verdict(blocks: Iterable[ToldBlock]) -> str:
    """Return the first failed verdict, empty if there is none."""
    failed = (each for each in blocks if isinstance(each, Verdict) and each.passed is False)
    return next((each.text for each in failed), "")


@dataclass
class StartingJob:
    """A job whose worker is on its way.

    Attributes:
        job: As it is journalled.
        stopping: Why it is not to begin; empty where it is.
    """

    job: Job
    stopping: str = ""

    def stop(self, why: str, _code: StopCode) -> None:
        """Have it not begin."""
        self.stopping = self.stopping or why


class WarmWorker:
    """A worker that is ready before there is a job: it has imported what jobs need.

    Args:
        log: Where workers write what is no event: mistakes of the program.
    """

    def __init__(self, log: Path) -> None:
        self._log = log
        self._ready: WorkerProcess | None = None

    async def prepare(self) -> None:
        """Start one, where none is ready."""
        if self._ready is None or self._ready.process.returncode is not None:
            self._ready = await self._start()

    async def take(self) -> WorkerProcess:
        """Return a worker that waits for its job."""
        ready, self._ready = self._ready, None
        if ready is not None and ready.process.returncode is None:
            return ready
        return await self._start()

    async def end(self) -> None:
        """End the one that is ready."""
        ready, self._ready = self._ready, None
        if ready is not None and ready.process.returncode is None:
            ready.process.kill()
            await ready.process.wait()

    async def _start(self) -> WorkerProcess:
        beat = ServiceBeat.create()
        with self._log.open("ab") as log:
            process = await asyncio.create_subprocess_exec(
                *own_python("rid_daq.worker", str(beat.descriptor)),
                stdin=asyncio.subprocess.PIPE,
                stdout=log,
                stderr=log,
                start_new_session=True,
                pass_fds=(beat.descriptor,),
            )
        return WorkerProcess(process, beat)
