"""`JobRunner`: running jobs, each in its own worker process, and the queue of waiting jobs."""

from __future__ import annotations

import asyncio
import json
import logging
import os
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
from rid_daq.service.logs import LOG, ErrorIsolator
from rid_daq.service.readiness import Readiness
from rid_daq.service.records import Job, JobState
from rid_daq.service.refusals import StoreBusyError
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.store.audit import AuditLog
from rid_daq.service.store.jobs import JobStore
from rid_daq.service.workers.live_values import LiveValues
from rid_daq.service.workers.running_job import EventTail, RunningJob, StartingJob
from rid_daq.service.workers.worker_template import WorkerTemplate
from rid_daq.terminal.job_events import EndEvent, MotionEvent

LOOK_S: Final = 0.05
_BY_TERM: Final = (-signal.SIGTERM, 128 + signal.SIGTERM)
"""Exit codes of a worker that SIGTERM ends before it can report its end; nothing has moved."""

END_PATIENCE_S: Final = 20.0
NICENESS: Final = 10


class JobRunner:
    """Starts workers, supervises them and saves the outcome of their jobs.

    Args:
        folder, runs, state: Folder of relative paths, folder of the run folders, folder of the
            jobs' event files.
        jobs: Database table of jobs.
        audit: Log of user actions.
        leases: Leases of the cells.
        readiness: Results of preflights, and open faults.
        live: Publishes the values of motions, with the feed for events.

    Attributes:
        closing: True if no more jobs are started.
        bus_owners_changed: Called with the process id of each job that uses a cell's bus, by cell;
            0 for a job that is being started.
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
        live: LiveValues,
    ) -> None:
        self._folder, self._runs, self._state = folder, runs, state
        (state / "jobs").mkdir(parents=True, exist_ok=True, mode=0o700)
        self._jobs = jobs
        self._audit = audit
        self._leases = leases
        self._readiness = readiness
        self._feed, self._live = live.feed, live
        self._running: dict[str, RunningJob] = {}
        self._queue: deque[tuple[Job, ServedCell]] = deque()
        self._unsaved: set[str] = set()
        self.bus_owners_changed: Callable[[dict[str, int]], None] = lambda _jobs: None
        self._starting: dict[str, StartingJob] = {}
        self._errors = ErrorIsolator()
        self._template = WorkerTemplate(state / "workers.log")
        self._mark_interrupted_jobs()

    def __iter__(self) -> Iterator[RunningJob]:
        return iter(tuple(self._running.values()))

    def get(self, job_id: str) -> RunningJob | None:
        """Return a running job, None if no such job is running."""
        return self._running.get(job_id)

    def job_on_bus(self, cell: str) -> RunningJob | None:
        """Return the running job that uses a cell's bus, None if there is no such job."""
        of_cell = (each for each in self._running.values() if each.job.cell == cell)
        return next((each for each in of_cell if each.job.kind.operation.opens_cell), None)

    def is_busy(self, cell: str) -> bool:
        """Return True if a job uses a cell's bus, or is being started on it."""
        return self._job_starting_on(cell) is not None or self.job_on_bus(cell) is not None

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
        """Save a job and start it; a job that only computes may have to wait for its turn.

        Args:
            job: A new job.
            cleared: True if a person has just confirmed that the cell is clear.
            approved: SHA-256 of the files with which the job was accepted, by their paths.

        Raises:
            StoreBusyError: The job could not be saved in time; it is not started.
        """
        self._jobs.add(job)
        self._publish(job)
        if not job.kind.operation.opens_cell:
            self._queue.append((job, cell))
            self._unsaved.add(job.id)
            await self._wait_until_journaled(job)
            await self._begin_next()
            return self._jobs.in_memory(job.id) or job
        return await self._start(job, cell, cleared=cleared, approved=approved)

    def stop(self, cell: str, why: str) -> Job | None:
        """Stop the job that uses a cell's bus or is being started on it; return the job."""
        begun = self.job_on_bus(cell) or self._job_starting_on(cell)
        if begun is None:
            return None
        begun.stop(why, StopCode.STOP_BUTTON)
        return begun.job

    def cancel(self, job: Job, who: str) -> None:
        """End a job: a waiting job does not start, a running job is stopped."""
        waiting = next((each for each in self._queue if each[0].id == job.id), None)
        if waiting is not None:
            self._queue.remove(waiting)
            self._record_state(job, JobState.STOPPED, f"cancelled by {who} before it started")
        elif begun := self._running.get(job.id) or self._starting.get(job.id):
            begun.stop(f"cancelled by {who}", StopCode.STOP_BUTTON)

    async def prepare(self) -> None:
        """Start the template of the workers unless it runs."""
        with self._errors.isolate("template of the workers"):
            await self._template.prepare()

    async def poll(self) -> None:
        """Publish new events of jobs, save the outcome of ended jobs, start waiting jobs."""
        for running in self:
            with self._errors.isolate(f"job {running.job.id}", partial(_stop_unwatched, running)):
                self._publish_events(running)
                self._watch_lease(running)
                running.repeat_stop()
                if running.is_over:
                    self._publish_events(running)
                    self._record_end(running)
        if not self.closing:
            with self._errors.isolate("the next job that only computes"):
                await self._begin_next()
            if not self._running:
                await self.prepare()

    def send_heartbeats(self) -> None:
        """Send every worker the service's heartbeat and the end time of its motion's lease."""
        now_s = safety_now_s()
        for running in self:
            running.process.beat.write(now_s, self._lease_end_s(running.job))

    async def close(self) -> None:
        """Stop all motions, end all computations, and save the outcome of every job."""
        self.closing = True
        for running in self:
            running.stop("the service ended", StopCode.INTERRUPTED)
        until_s = time.monotonic() + END_PATIENCE_S
        while self._running and time.monotonic() < until_s:
            await self.poll()
            await asyncio.sleep(LOOK_S)
        for running in self:
            if not running.is_over:
                running.process.kill()
            await running.process.wait()
            with self._errors.isolate(f"job {running.job.id}"):
                self._publish_events(running)
                self._record_end(running)
        await self._template.end()
        for job, _ in self._queue:
            self._record_state(
                job, JobState.INTERRUPTED, "the service ended before the job started"
            )

    def _publish_events(self, running: RunningJob) -> None:
        first = running.events_read
        for number, event in enumerate(running.read_events(), first):
            if isinstance(event, MotionEvent):
                running.job = self._jobs.change(running.job, run=event.run)
            head = {"type": "event", "job": running.job.id, "number": number}
            message = {**head, "event": event.model_dump()}
            self._feed.publish_event(json.dumps(message).encode())
        self._live.update(running)

    def _watch_lease(self, running: RunningJob) -> None:
        job = running.job
        if not running.stopping and self._lease_end_s(job) == -inf:
            running.stop(f"{job.owner} has lost the lease of the cell", StopCode.CLIENT_LOST)
            self._audit.note(
                job.owner, "lost the lease of the cell", job.cell, f"job {job.id} stopped"
            )

    def _lease_end_s(self, job: Job) -> float:
        """Return the time at which a job stops unless its lease is renewed [s, safety clock]."""
        if job.kind.operation.moves and job.on_lost_client == "stop":
            return self._leases.end_s(job.cell, job.lease)
        return inf

    def _record_end(self, running: RunningJob) -> None:
        """Save the outcome of a job whose worker has ended."""
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
        self._report_bus_owners(without=job.id)
        del self._running[job.id]  # last step: if a step above fails, the next poll repeats them
        self._feed.forget_picture(cell.name)
        level = logging.INFO if state is JobState.DONE else logging.WARNING
        LOG.log(level, "job over: %s", reason or state.value, extra={"job": job})
        self._publish(job)

    async def _begin_next(self) -> None:
        """Start the next job that only computes, unless one is running."""
        begun = (*self, *self._starting.values())
        first = next((each for each in self._queue if each[0].id not in self._unsaved), None)
        if first is not None and all(each.job.kind.operation.opens_cell for each in begun):
            self._queue.remove(first)
            await self._start(*first, cleared=False)

    async def _wait_until_journaled(self, job: Job) -> None:
        """Wait until a new job is on the disk; mark the job as failed if that takes too long."""
        try:
            await self._jobs.wait_until_saved()
        except StoreBusyError as error:
            self._queue = deque(each for each in self._queue if each[0].id != job.id)
            self._record_state(job, JobState.FAILED, f"the job was not started: {error}")
            raise
        finally:
            self._unsaved.discard(job.id)

    def _job_starting_on(self, cell: str) -> StartingJob | None:
        """Return the job that is being started on a cell's bus, None if there is no such job."""
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
        self._report_bus_owners()
        try:
            if job.kind.operation.opens_cell:
                await self._wait_until_journaled(job)
            worker = await self._template.start_worker()
        except OSError as error:
            reason = f"the job's process cannot be started: {error.strerror}"
            return self._record_state(job, JobState.FAILED, reason)
        finally:
            del self._starting[job.id]
            self._report_bus_owners()
        if starting.stopping:
            worker.kill()
            await worker.wait()
            return self._record_state(
                job, JobState.STOPPED, f"{starting.stopping} before it started"
            )
        job = self._jobs.change(job, state=JobState.RUNNING, began_s=time.time(), pid=worker.pid)
        running = RunningJob(job, cell, worker, self.events(job.id))
        self._running[job.id] = running
        self.send_heartbeats()
        self._report_bus_owners()
        running.send_order(
            kind=job.kind.value,
            request=job.request,
            cell=cell.reference,
            runs=str(self._runs),
            folder=str(self._folder),
            events=str(self.events(job.id)),
            cleared=cleared,
            owner=job.owner,
            service=os.getpid(),
            niceness=0 if job.kind.operation.opens_cell else NICENESS,
            approved=dict(approved or {}),
        )
        LOG.info("job started", extra={"job": job})
        self._publish(job)
        return job

    def _report_bus_owners(self, without: str = "") -> None:
        """Report the process id of the job on each cell's bus; 0 for a job that is starting."""
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
        self.bus_owners_changed(jobs)

    def _mark_interrupted_jobs(self) -> None:
        """Mark the unfinished jobs of a killed service as interrupted; they are not repeated."""
        for job in self._jobs.unfinished():
            begun = job.state is JobState.RUNNING
            run = ended = None
            for event in EventTail(self.events(job.id)).read_new():
                if isinstance(event, MotionEvent):
                    run = event.run
                if isinstance(event, EndEvent):
                    ended = event
            reason = "the service was killed before the job started"
            if begun:
                stopped = "; the drives have stopped by themselves"
                reason = "the service was killed" + job.kind.operation.opens_cell * stopped
            if begun and ended is not None:
                reason = "the service was killed; the job's process has ended its motion"
            elif job.kind.operation.moves and run is not None:
                self._readiness.note_death(job.cell, reason)
            job = job.model_copy(update={"run": run or job.run})
            self._record_state(job, JobState.INTERRUPTED, reason)

    def _record_state(self, job: Job, state: JobState, reason: str) -> Job:
        job = self._jobs.change(job, state=state, ended_s=time.time(), reason=reason)
        self._publish(job)
        return job

    def _publish(self, job: Job) -> None:
        message = {"type": "job", "job": job.model_dump(mode="json")}
        self._feed.publish_event(json.dumps(message).encode())


def _stop_unwatched(running: RunningJob) -> None:
    """Stop a job that the service cannot supervise."""
    if not (running.stopping or running.is_over):
        why = "the service could not supervise the job: see the service's log"
        running.stop(why, StopCode.INTERRUPTED)


def outcome_of_job(running: RunningJob, closing: bool) -> tuple[JobState, str]:
    """Return the final state of a job whose process has ended, and the reason in a sentence."""
    ended, document, code = running.ended, running.document, running.process.returncode
    if ended is None and running.stopping and running.run is None and code in _BY_TERM:
        return JobState.INTERRUPTED if closing else JobState.STOPPED, running.stopping
    if ended is None:
        stops = "; the drives stop by themselves" if running.job.kind.operation.opens_cell else ""
        return JobState.INTERRUPTED, f"the job's process died (exit code {code}){stops}"
    if closing:
        return JobState.INTERRUPTED, running.stopping
    if ended.exit_code == 0:
        return JobState.DONE, ""
    stop = None if document is None else document.get("stop")
    if running.stopping:
        return JobState.STOPPED, running.stopping
    if isinstance(stop, dict):
        return JobState.STOPPED, str(stop.get("text", ""))
    message = ended.message if ended.error not in (None, "Failure") else None
    return JobState.FAILED, message or running.last_bad or "see the messages of the job"
