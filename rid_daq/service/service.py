"""`CellService`: cells, their jobs and access rights, independent of HTTP.

One job at a time uses the bus of a cell. A job is saved in the database before its worker starts.
Jobs that only compute run one after the other. A motion can be stopped even if the service hangs.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from acquisition.hold_to_run.held_key import KeyMessage
from acquisition.runs.run_id import new_run_id
from acquisition.task.service_beat import SERVICE_LIMIT_S
from config.errors import ConfigError, LockedError, PreflightError
from config.process.safety_clock import safety_now_s
from rid_daq.service.files.edited_file import FileLocks
from rid_daq.service.files.editors import Editors
from rid_daq.service.folder_files import Uploads
from rid_daq.service.job_kinds import JobKind, held_kinds
from rid_daq.service.job_runner import JobRunner
from rid_daq.service.leases import Leases
from rid_daq.service.logs import LOG, ErrorIsolator
from rid_daq.service.readiness import PREFLIGHT_LIMIT_S, Readiness
from rid_daq.service.records import (
    CellState,
    CellStatus,
    Identity,
    Job,
    JobState,
    OnLostClient,
    Role,
)
from rid_daq.service.refusals import NotAllowedError, UnknownError
from rid_daq.service.request_check import check_request, hash_named_files, request_schemas
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.store.audit import AuditLog
from rid_daq.service.store.cells import CellStore
from rid_daq.service.store.database import open_database
from rid_daq.service.store.jobs import JobStore
from rid_daq.service.store.leases import LeaseStore
from rid_daq.service.store.state_folder import open_state_folder
from rid_daq.service.store.tokens import TokenStore
from rid_daq.service.workers.live_values import LiveValues
from rid_daq.web.feed import Feed

LOOK_S: Final = 0.05
CELLS_S: Final = 0.2
BEAT_S: Final = 0.1
MOST_EVENTS: Final = 2000


class CellService:
    """Cells that this process owns, with their jobs, leases and tokens.

    Args:
        folder: Folder of runs, motions and models. Clients can name files in this folder only.

    Raises:
        ConfigError: Two cells have the same name.
        RecordingError: The service's saved state cannot be read or written.
    """

    def __init__(self, folder: Path, cells: Sequence[ServedCell]) -> None:
        self.folder = folder.resolve()
        self.runs = self.folder / "runs"
        self.cells = {cell.name: cell for cell in cells}
        if len(self.cells) != len(cells):
            raise ConfigError(
                "two cells have the same name: give each cell its own name",
                code="RID-SERVICE-CELLS",
            )
        state = open_state_folder(self.folder)
        self.database = open_database(state / "service.db")
        self.jobs = JobStore(self.database)
        self.tokens = TokenStore(self.database)
        self.audit = AuditLog(self.database)
        self.leases = Leases(LeaseStore(self.database))
        cell_store = CellStore(self.database)
        for name in self.cells:
            cell_store.add(name)
        self.readiness = Readiness(cell_store)
        self.feed = Feed(MOST_EVENTS)
        self.live = LiveValues(self.feed, self.cells)
        self.job_runner = JobRunner(
            self.folder,
            self.runs,
            state,
            jobs=self.jobs,
            audit=self.audit,
            leases=self.leases,
            readiness=self.readiness,
            live=self.live,
        )
        self.uploads, self.file_locks, self.editors = Uploads(), FileLocks(), Editors()
        self.started_s, self.began_s = time.time(), safety_now_s()
        self.stops = 0
        self._published: dict[str, str] = {}
        self._beat_s: float | None = None
        self._errors = ErrorIsolator()

    def cell(self, name: str) -> ServedCell:
        """Return a cell by its name.

        Raises:
            UnknownError: The service has no cell with this name.
        """
        found = self.cells.get(name)
        if found is None:
            raise UnknownError(
                f"no cell {name!r} in this service; its cells are {', '.join(self.cells)}",
                code="RID-CELL-UNKNOWN",
            )
        return found

    def job(self, job_id: str) -> Job:
        """Return a job by its id.

        Raises:
            UnknownError: No job has this id.
        """
        found = self.jobs.get(job_id)
        if found is None:
            raise UnknownError(f"no job {job_id!r}", code="RID-JOB-UNKNOWN")
        return found

    def status(self, cell: ServedCell) -> CellStatus:
        """Return the public status of a cell: state, fault, preflight, job and lease."""
        running = self.job_runner.job_on_bus(cell.name)
        obstacle = self.readiness.obstacle(cell)
        fault = self.readiness.fault(cell)
        if running is not None:
            state = running.cell_state
        elif fault:
            state = CellState.FAULT
        else:
            state = CellState.CLOSED if obstacle else CellState.READY
        loaded = cell.loaded
        return CellStatus(
            cell=cell.name,
            robot=loaded.robot.name,
            joints=loaded.robot.joint_names,
            simulated=loaded.config.simulated,
            pace=cell.pace,
            files_hash=loaded.files_hash,
            state=state,
            fault=fault,
            preflight_age_s=None if obstacle and not fault else self.readiness.age_s(cell),
            preflight_limit_s=PREFLIGHT_LIMIT_S,
            not_ready_because=obstacle,
            not_held_because=self.readiness.obstacle(cell, held_kinds()[0]),
            job=None if running is None else running.job,
            lease=self.leases.lease_of(cell.name),
        )

    async def begin(
        self,
        cell: ServedCell,
        kind: JobKind,
        request: dict[str, Any],
        who: Identity,
        *,
        lease: str | None = None,
        cleared: bool = False,
        on_lost_client: OnLostClient = "stop",
    ) -> Job:
        """Save a job and start it; a job that only computes may have to wait for its turn.

        Args:
            kind: Kind of the job.
            request: Request in the form of the operation's schema.
            who: Caller that starts the job.
            lease: Key of the cell's lease.
            cleared: True if a person has just confirmed that the cell is clear.
            on_lost_client: Action on a motion whose lease ends.

        Raises:
            ConfigError: The request is invalid for this kind of job.
            LockedError: The caller does not hold the cell, another job uses its bus, its files are
                being changed, or the service is shutting down.
            PreflightError: The cell is not ready to move, or no one has confirmed that it is clear.
            NotAllowedError: The caller has read-only access.
            StoreBusyError: The job could not be saved in time; it is not started.
        """
        require_role(who, Role.OPERATOR)
        if self.job_runner.closing:
            raise LockedError(
                "the service is shutting down: it starts no more jobs", code="RID-SERVICE-ENDING"
            )
        request = with_service_pace(kind, request, cell.own_pace())
        of_cells = [path for each in self.cells.values() for path in each.loaded.paths]
        await asyncio.to_thread(check_request, kind, request, self.folder, of_cells)
        approved: dict[str, str] = {}
        if kind.operation.moves:
            approved = await asyncio.to_thread(hash_named_files, request, self.folder)
        if kind.operation.opens_cell:
            self._require_free(cell, kind, lease, cleared=cleared)
        if kind.operation.moves:  # the contents of the files that passed the preflight
            approved |= {str(path): found for path, found in cell.loaded.hashes.items()}
        held = self.leases.lease_of(cell.name)
        job = Job(
            id=new_run_id(time.time_ns()),
            cell=cell.name,
            kind=kind,
            state=JobState.ACCEPTED,
            owner=who.name,
            request=request,
            on_lost_client=on_lost_client,
            lease=held.id if kind.operation.opens_cell and held is not None else None,
            created_s=time.time(),
        )
        self.audit.note(who.name, f"began {kind.value}", cell.name, f"job {job.id}")
        return await self.job_runner.begin(job, cell, cleared=cleared, approved=approved)

    def stop(self, cell: str, who: str) -> bool:
        """Stop the motion in a cell; return True if a job received the stop."""
        job = self.job_runner.stop(cell, f"stopped by {who}")
        if job is None:
            return False
        self.stops += 1
        self.audit.note(who, "stopped", cell, f"job {job.id}")
        return True

    def cancel(self, job: Job, who: Identity) -> None:
        """End a job: a waiting job does not start, a running job is stopped.

        Raises:
            NotAllowedError: The caller has read-only access. Any caller can stop a motion with
                `stop`.
        """
        require_role(who, Role.OPERATOR)
        self.audit.note(who.name, "cancelled", job.cell, f"job {job.id}")
        self.job_runner.cancel(job, who.name)

    def answer(self, job: Job, question: int, text: str, who: Identity, lease: str | None) -> None:
        """Send an answer to the question of a job.

        Raises:
            LockedError: The job has no open question with this number, or the caller does not hold
                the cell.
            NotAllowedError: The caller has read-only access.
        """
        require_role(who, Role.OPERATOR)
        running = self.job_runner.get(job.id)
        open_question = None if running is None else running.question
        if running is None or open_question is None or open_question.question != question:
            raise LockedError(
                f"job {job.id} does not ask question {question} now", code="RID-JOB-UNKNOWN"
            )
        if job.kind.operation.opens_cell:
            self.leases.require(job.cell, lease)
        self.audit.note(who.name, "answered", job.cell, f"{open_question.text} {text}")
        running.send_order(answer=question, text=text)

    def jobs_wanting_keys(self) -> list[str]:
        """Return the ids of the jobs that require a held key now."""
        return [running.job.id for running in self.job_runner if running.wants_key]

    def forward_key(self, job_id: str, message: KeyMessage) -> None:
        """Forward a key message to the worker of a job, which decides if the key counts.

        The release of a key is forwarded even if the job requires no key now.
        """
        running = self.job_runner.get(job_id)
        if running is None or not (running.wants_key or message.is_release):
            return
        running.send_order_if_writable(**message.to_order())

    async def run(self, until: asyncio.Event) -> None:
        """Supervise jobs and leases until the event is set; then stop all motions and return."""
        await self.job_runner.prepare()
        beating = asyncio.create_task(self._send_heartbeats())
        try:
            await self._watch_jobs(until)
            await self.job_runner.close()
        finally:
            beating.cancel()
        await asyncio.to_thread(self.database.close)

    async def _watch_jobs(self, until: asyncio.Event) -> None:
        next_s = 0.0
        while not until.is_set():
            await self.job_runner.poll()
            if time.monotonic() >= next_s:
                next_s = time.monotonic() + CELLS_S
                for cell in self.cells.values():
                    with self._errors.isolate(f"cell {cell.name}"):
                        self._publish_cell(cell)
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(until.wait(), LOOK_S)

    async def _send_heartbeats(self) -> None:
        """Send heartbeats from the event loop; they show that it can still answer a STOP."""
        while True:
            with self._errors.isolate("heartbeats of the service"):
                self._void_preflights_after_pause()
                self.job_runner.send_heartbeats()
            await asyncio.sleep(BEAT_S)

    def _void_preflights_after_pause(self) -> None:
        """Void every preflight after a pause of this process, for example a suspended computer.

        A request that was sent during the pause is answered only now, and its sender no longer
        expects the robot to move.
        """
        now_s, before_s = safety_now_s(), self._beat_s
        self._beat_s = now_s
        if before_s is not None and now_s - before_s > SERVICE_LIMIT_S:
            still = f"the service was paused for {now_s - before_s:.0f} s"
            LOG.warning("%s; all preflights are void", still)
            self.readiness.void_all(f"{still}: repeat the preflight.")

    def _require_free(
        self, cell: ServedCell, kind: JobKind, lease: str | None, *, cleared: bool
    ) -> None:
        self.file_locks.require_none_of(cell)
        self._void_preflights_after_pause()
        cell.reload_if_changed()
        self.leases.require(cell.name, lease)
        running = self.job_runner.job_on_bus(cell.name)
        if self.job_runner.is_busy(cell.name):
            busy = "a job" if running is None else running.job.kind.value
            raise LockedError(
                f"cell {cell.name}: {busy} is running: wait for its end, or stop it",
                code="RID-JOB-RUNNING",
            )
        if not kind.operation.moves:
            return
        obstacle = self.readiness.obstacle(cell, kind)
        if obstacle:
            raise PreflightError(
                f"cell {cell.name} is not ready: {obstacle}", code="RID-CELL-NOT-READY"
            )
        if not (cleared or cell.loaded.config.simulated):
            raise PreflightError(
                f"cell {cell.name} is real: confirm before each motion that no one is in the cell"
                " and that the emergency stop is within reach (cleared)",
                code="RID-ANSWER-NO",
            )

    def _publish_cell(self, cell: ServedCell) -> None:
        """Send the status of a cell to all viewers if it has changed."""
        status = self.status(cell).model_dump(mode="json", exclude={"preflight_age_s"})
        message = json.dumps({"type": "cell", "cell": status})
        if self._published.get(cell.name) != message:
            self._published[cell.name] = message
            self.feed.publish_event(message.encode())


def require_role(who: Identity, role: Role) -> None:
    """Raise an error if the caller's role does not include a role.

    Raises:
        NotAllowedError: The role of the caller is insufficient.
    """
    if not who.role.includes(role):
        raise NotAllowedError(
            f"{who.name} has the role {who.role.value}: this request needs {role.value}",
            code="RID-ACCESS-ROLE",
        )


def with_service_pace(kind: JobKind, request: dict[str, Any], pace: float | None) -> dict[str, Any]:
    """Return the request with the service's pace for simulated cells, if it sets no pace itself."""
    known = request_schemas()[kind.value]["properties"]
    if pace is None:
        return request
    if "pace" in known:
        return {"pace": pace, **request}
    if "simulation" in known:
        simulation = request.get("simulation", {})
        if isinstance(simulation, dict) and not simulation.get("realtime"):
            return {**request, "simulation": {"pace": pace, **simulation}}
    return request
