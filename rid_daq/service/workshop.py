"""`Workshop`: the jobs that run, each by its own worker, and those that wait."""

from __future__ import annotations

import asyncio
import json
import logging
import signal
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from math import inf
from pathlib import Path
from typing import Final

from acquisition.supervision.stop_reason import StopCode
from config.process.safety_clock import safety_now_s
from rid_daq.service.leases import Leases
from rid_daq.service.logs import LOG, Mishaps
from rid_daq.service.readiness import Readiness
from rid_daq.service.records import Job, JobState
from rid_daq.service.refusals import StoreBusyError
from rid_daq.service.running_job import EventTail, RunningJob, StartingJob, WarmWorker
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.store.audit import AuditLog
from rid_daq.service.store.jobs import JobStore
from rid_daq.terminal.job_events import Ended, MotionBegun
from rid_daq.web.feed import Feed

LOOK_S: Final = 0.05
_BY_TERM: Final = (-signal.SIGTERM, 128 + signal.SIGTERM)
"""How a worker ends that is told to before it can say so; nothing has moved."""

END_PATIENCE_S: Final = 20.0
NICENESS: Final = 10


class Workshop:
    """Starts workers, watches them, and writes what became of their jobs.

    Args:
        folder, runs, state: Where relative paths begin, where runs lie, where events of jobs are
            kept.
        jobs: The journal of jobs.
        audit: Who did what.
        leases: Who has which cell.
        readiness: Where checks and faults are kept.
        feed: Tells everybody what happens.

    Attributes:
        closing: Whether nothing more is begun.
        changed: Told the process of every cell whose bus a job has open, 0 for one that is being
            started.
    """

    closing = False

    def __init__(
        self,
        folder: Path,
        runs: Path,
        state: Path,
        *,
        jobs: JobStore,
        audit: AuditLog,
        leases: Leases,
        readiness: Readiness,
        feed: Feed,
    ) -> None:
        self._folder, self._runs, self._state = folder, runs, state
        (state / "jobs").mkdir(parents=True, exist_ok=True, mode=0o700)
        self._jobs = jobs
        self._audit = audit
        self._leases = leases
        self._readiness = readiness
        self._feed = feed
        self._running: dict[str, RunningJob] = {}
        self._queue: deque[tuple[Job, ServedCell]] = deque()
        self._unsaved: set[str] = set()
        self.changed: Callable[[dict[str, int]], None] = lambda _jobs: None
        self._starting: dict[str, StartingJob] = {}
        self._mishaps = Mishaps()
        self._warm = WarmWorker(state / "workers.log")
        self._interrupt_leftovers()

    def __iter__(self) -> Iterator[RunningJob]:
        return iter(tuple(self._running.values()))

    def get(self, job_id: str) -> RunningJob | None:
        """Return a job that runs, None where it does not."""
        return self._running.get(job_id)

    def of_cell(self, cell: str) -> RunningJob | None:
        """Return the job that has a cell's bus open, None where none has."""
        of_cell = (each for each in self._running.values() if each.job.cell == cell)
        return next((each for each in of_cell if each.job.kind.operation.opens_cell), None)

    def is_busy(self, cell: str) -> bool:
        """Whether a job has a cell's bus open, or is just being started."""
        return self._starting_on(cell) is not None or self.of_cell(cell) is not None

    def events(self, job_id: str) -> Path:
        """Return the file of a job's events."""
        return self._state / "jobs" / f"{job_id}.jsonl"

    async def begin(
        self,
        job: Job,
        cell: ServedCell,
        *,
        cleared: bool,
        approved: Mapping[str, str] | None = None,
    ) -> Job:
        """Journal a job and begin it; one that only computes may have to wait for its turn.

        Args:
            job: A new job.
            cleared: Whether a person has just said that nobody is in the cell.
            approved: The SHA-256 of the files that the job was accepted with, by their paths.
        """
        self._jobs.add(job)
        self._publish(job)
        if not job.kind.operation.opens_cell:
            self._queue.append((job, cell))
            self._unsaved.add(job.id)
            await self._journal(job)
            await self._begin_next()
            return self._jobs.kept(job.id) or job
        return await self._start(job, cell, cleared=cleared, approved=approved)

    def stop(self, cell: str, why: str) -> Job | None:
        """Stop the job that has a cell's bus open, or is just being started; return it."""
        begun = self.of_cell(cell) or self._starting_on(cell)
        if begun is None:
            return None
        begun.stop(why, StopCode.STOP_BUTTON)
        return begun.job

    def cancel(self, job: Job, who: str) -> None:
        """End a job: one that waits does not begin, one that runs is stopped."""
        waiting = next((each for each in self._queue if each[0].id == job.id), None)
        if waiting is not None:
            self._queue.remove(waiting)
            self._change(job, JobState.STOPPED, f"cancelled by {who} before it began")
        elif begun := self._running.get(job.id) or self._starting.get(job.id):
            begun.stop(f"cancelled by {who}", StopCode.STOP_BUTTON)

    async def prepare(self) -> None:
        """Have a worker ready before there is a job."""
        with self._mishaps.of("a worker that waits for its job"):
            await self._warm.prepare()

    async def look(self) -> None:
        """Pass on what jobs say, settle those that are over, begin what waits."""
        for running in self:
            with self._mishaps.of(f"job {running.job.id}", partial(_give_up, running)):
                self._pass_on(running)
                self._watch_lease(running)
                running.insist()
                if running.is_over:
                    self._pass_on(running)
                    self._settle(running)
        if not self.closing:
            with self._mishaps.of("the next job that only computes"):
                await self._begin_next()
            if not self._running:
                await self.prepare()

    def give_signs_of_life(self) -> None:
        """Tell every worker that the service lives, and until when its motion's client does."""
        now_s = safety_now_s()
        for running in self:
            running.beat.write(now_s, self._lease_end_s(running.job))

    async def close(self) -> None:
        """Stop what moves, end what computes, and mark all of it."""
        self.closing = True
        for running in self:
            running.stop("the service ended", StopCode.INTERRUPTED)
        until_s = time.monotonic() + END_PATIENCE_S
        while self._running and time.monotonic() < until_s:
            await self.look()
            await asyncio.sleep(LOOK_S)
        for running in self:
            if not running.is_over:
                running.process.kill()
            await running.process.wait()
            with self._mishaps.of(f"job {running.job.id}"):
                self._pass_on(running)
                self._settle(running)
        await self._warm.end()
        for job, _ in self._queue:
            self._change(job, JobState.INTERRUPTED, "the service ended before it began")

    def _pass_on(self, running: RunningJob) -> None:
        for event in running.look():
            if isinstance(event, MotionBegun):
                running.job = self._jobs.change(running.job, run=event.run)
            told = {"type": "event", "job": running.job.id, "event": event.model_dump()}
            self._feed.tell(json.dumps(told).encode())
        if self._feed.viewers:
            picture = running.samples()
            if picture is not None:
                told = {"type": "samples", "cell": running.job.cell, "job": running.job.id}
                shown = json.dumps({**told, "picture": picture})
                self._feed.show(shown.encode(), running.job.cell)

    def _watch_lease(self, running: RunningJob) -> None:
        job = running.job
        if not running.stopping and self._lease_end_s(job) == -inf:
            running.stop(f"{job.owner} is out of reach", StopCode.CLIENT_LOST)
            self._audit.note(job.owner, "was out of reach", job.cell, f"job {job.id} stopped")

    def _lease_end_s(self, job: Job) -> float:
        """Return when a job stops unless its client shows itself, on the safety clock [s]."""
        if job.kind.operation.moves and job.on_lost_client == "stop":
            return self._leases.end_s(job.cell, job.lease)
        return inf

    def _settle(self, running: RunningJob) -> None:
        """Write what became of a job whose worker has ended."""
        job, cell = running.job, running.cell
        document, ended = running.document, running.ended
        state, reason = outcome_of_job(running, self.closing)
        run = running.run or (document or {}).get("run")
        job = self._jobs.change(
            job,
            state=state,
            ended_s=time.time(),
            exit_code=None if ended is None else ended.exit_code,
            reason=reason,
            run=run if isinstance(run, str) else None,
        )
        if job.kind == "check":
            self._readiness.note_check(cell, document)
        elif job.kind == "reset" and state is JobState.DONE:
            self._readiness.note_reset(cell)
        elif job.kind.operation.moves:
            self._readiness.note_end(cell, document)
            if ended is None and running.run is not None:
                self._readiness.note_death(cell.name, reason)
        self._report_changes(without=job.id)
        del self._running[job.id]  # all of it is written: until then it is tried again
        self._feed.forget(cell.name)
        level = logging.INFO if state is JobState.DONE else logging.WARNING
        LOG.log(level, "job over: %s", reason or state.value, extra={"job": job})
        self._publish(job)

    async def _begin_next(self) -> None:
        """Begin the next job that only computes, where none does."""
        begun = (*self, *self._starting.values())
        first = next((each for each in self._queue if each[0].id not in self._unsaved), None)
        if first is not None and all(each.job.kind.operation.opens_cell for each in begun):
            self._queue.remove(first)
            await self._start(*first, cleared=False)

    async def _journal(self, job: Job) -> None:
        """Wait until a new job is on the disk; it fails if that takes too long."""
        try:
            await self._jobs.saved()
        except StoreBusyError as error:
            self._queue = deque(each for each in self._queue if each[0].id != job.id)
            self._change(job, JobState.FAILED, f"it was not begun: {error}")
            raise
        finally:
            self._unsaved.discard(job.id)

    def _starting_on(self, cell: str) -> StartingJob | None:
        """Return the job that will have a cell's bus open, None where none is being started."""
        of_cell = (each for each in self._starting.values() if each.job.cell == cell)
        return next((each for each in of_cell if each.job.kind.operation.opens_cell), None)

    async def _start(
        self,
        job: Job,
        cell: ServedCell,
        *,
        cleared: bool,
        approved: Mapping[str, str] | None = None,
    ) -> Job:
        starting = self._starting[job.id] = StartingJob(job)
        self._report_changes()
        try:
            if job.kind.operation.opens_cell:
                await self._journal(job)
            worker = await self._warm.take()
        except OSError as error:
            reason = f"its process cannot be started: {error.strerror}"
            return self._change(job, JobState.FAILED, reason)
        finally:
            del self._starting[job.id]
            self._report_changes()
        process = worker.process
        if starting.stopping:
            process.kill()
            await process.wait()
            return self._change(job, JobState.STOPPED, f"{starting.stopping} before it began")
        job = self._jobs.change(job, state=JobState.RUNNING, began_s=time.time(), pid=process.pid)
        running = RunningJob(job, cell, worker, self.events(job.id))
        self._running[job.id] = running
        self.give_signs_of_life()
        self._report_changes()
        running.order(
            kind=job.kind.value,
            request=job.request,
            cell=cell.reference,
            runs=str(self._runs),
            folder=str(self._folder),
            events=str(self.events(job.id)),
            cleared=cleared,
            owner=job.owner,
            niceness=0 if job.kind.operation.opens_cell else NICENESS,
            approved=dict(approved or {}),
        )
        LOG.info("job begun", extra={"job": job})
        self._publish(job)
        return job

    def _report_changes(self, without: str = "") -> None:
        """Say which process has which cell's bus open; 0 for one that is on its way."""
        jobs = {
            each.job.cell: 0
            for each in self._starting.values()
            if each.job.kind.operation.opens_cell
        }
        jobs |= {
            each.job.cell: each.process.pid
            for each in self
            if each.job.kind.operation.opens_cell and each.job.id != without
        }
        self.changed(jobs)

    def _interrupt_leftovers(self) -> None:
        """Mark the jobs of a service that was killed; none of them runs again by itself."""
        for job in self._jobs.unfinished():
            begun = job.state is JobState.RUNNING
            run = ended = None
            for event in EventTail(self.events(job.id)).new():
                if isinstance(event, MotionBegun):
                    run = event.run
                if isinstance(event, Ended):
                    ended = event
            reason = "the service was killed before it began"
            if begun:
                reason = "the service was killed; the drives have stopped by their own watch"
            if begun and ended is not None:
                reason = "the service was killed; the job's own process has ended its motion"
            elif job.kind.operation.moves and run is not None:
                self._readiness.note_death(job.cell, reason)
            job = job.model_copy(update={"run": run or job.run})
            self._change(job, JobState.INTERRUPTED, reason)

    def _change(self, job: Job, state: JobState, reason: str) -> Job:
        job = self._jobs.change(job, state=state, ended_s=time.time(), reason=reason)
        self._publish(job)
        return job

    def _publish(self, job: Job) -> None:
        told = {"type": "job", "job": job.model_dump(mode="json")}
        self._feed.tell(json.dumps(told).encode())


def _give_up(running: RunningJob) -> None:
    """Stop a job that cannot be watched."""
    if not (running.stopping or running.is_over):
        running.stop("the service could not watch it: see its log", StopCode.INTERRUPTED)


def outcome_of_job(running: RunningJob, closing: bool) -> tuple[JobState, str]:
    """Return what became of a job whose process has ended, and why in a sentence."""
    ended, document, code = running.ended, running.document, running.process.returncode
    if ended is None and running.stopping and running.run is None and code in _BY_TERM:
        return JobState.INTERRUPTED if closing else JobState.STOPPED, running.stopping
    if ended is None:
        died = f"its process died (exit code {code}); the drives stop by their own watch"
        return JobState.INTERRUPTED, died
    if closing:
        return JobState.INTERRUPTED, running.stopping
    if ended.exit_code == 0:
        return JobState.DONE, ""
    stop = None if document is None else document.get("stop")
    if running.stopping:
        return JobState.STOPPED, running.stopping
    if isinstance(stop, dict):
        return JobState.STOPPED, str(stop.get("text", ""))
    told = ended.message if ended.error not in (None, "Failure") else None
    return JobState.FAILED, told or running.last_bad or "see what it said"
