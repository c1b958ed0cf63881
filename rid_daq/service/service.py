"""`CellService`: cells, their jobs and who may do what; nothing here speaks HTTP.

One job a cell at a time, journalled before its worker is told to begin. Jobs that only compute wait
for one another. Whatever the service does, a motion can be stopped without it.
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
from rid_daq.service.folder_files import Putting
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.leases import Leases
from rid_daq.service.logs import LOG, Mishaps
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
from rid_daq.service.request_check import check_request, hashes_of_named, request_schemas
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.store.audit import AuditLog
from rid_daq.service.store.cells import CellStore
from rid_daq.service.store.database import open_database
from rid_daq.service.store.jobs import JobStore
from rid_daq.service.store.leases import LeaseStore
from rid_daq.service.store.state_folder import open_state_folder
from rid_daq.service.store.tokens import TokenStore
from rid_daq.service.workshop import Workshop
from rid_daq.web.feed import Feed

LOOK_S: Final = 0.05
CELLS_S: Final = 0.2
BEAT_S: Final = 0.1
MOST_EVENTS: Final = 2000


class CellService:
    """The cells that this process owns.

    Args:
        folder: Where runs, motions and models lie; what clients name is inside of it.

    Raises:
        ConfigError: Two cells have one name.
        RecordingError: What the service keeps cannot be read or written.
    """

    def __init__(self, folder: Path, cells: Sequence[ServedCell]) -> None:
        self.folder = folder.resolve()
        self.runs = self.folder / "runs"
        self.cells = {cell.name: cell for cell in cells}
        if len(self.cells) != len(cells):
            raise ConfigError(
                "two of the cells have one name: give each its own", code="RID-SERVICE-CELLS"
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
        self.workshop = Workshop(
            self.folder,
            self.runs,
            state,
            jobs=self.jobs,
            audit=self.audit,
            leases=self.leases,
            readiness=self.readiness,
            feed=self.feed,
        )
        self.putting = Putting()
        self.started_s, self.began_s = time.time(), safety_now_s()
        self.stops = 0
        self._told: dict[str, str] = {}
        self._beat_s: float | None = None
        self._mishaps = Mishaps()

    def cell(self, name: str) -> ServedCell:
        """Return a cell by its name.

        Raises:
            UnknownError: There is none.
        """
        found = self.cells.get(name)
        if found is None:
            raise UnknownError(
                f"no cell {name!r} here; there are {', '.join(self.cells)}", code="RID-CELL-UNKNOWN"
            )
        return found

    def job(self, job_id: str) -> Job:
        """Return a job by its id.

        Raises:
            UnknownError: There is none.
        """
        found = self.jobs.get(job_id)
        if found is None:
            raise UnknownError(f"no job {job_id!r}", code="RID-JOB-UNKNOWN")
        return found

    def status(self, cell: ServedCell) -> CellStatus:
        """Return what everybody may see of a cell."""
        running = self.workshop.of_cell(cell.name)
        obstacle = self.readiness.obstacle(cell)
        fault = self.readiness.fault(cell)
        if running is not None and not running.job.kind.operation.moves:
            state = CellState.CHECKING
        elif running is not None:
            state = CellState.STOPPING if running.stopping else CellState.MOVING
        elif fault:
            state = CellState.FAULT
        else:
            state = CellState.CLOSED if obstacle else CellState.READY
        robot = cell.loaded.robot
        return CellStatus(
            cell=cell.name,
            robot=robot.name,
            joints=robot.joint_names,
            simulated=cell.loaded.config.simulated,
            pace=cell.pace,
            state=state,
            fault=fault,
            preflight_age_s=None if obstacle and not fault else self.readiness.age_s(cell),
            preflight_limit_s=PREFLIGHT_LIMIT_S,
            not_ready_because=obstacle,
            not_held_because=self.readiness.obstacle(cell, JobKind("axes")),
            job=None if running is None else running.job,
            lease=self.leases.of(cell.name),
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
        """Journal a job and begin it; one that only computes may have to wait for its turn.

        Args:
            kind: What is done.
            request: What is asked for, as the schema of its operation has it.
            who: Who asks.
            lease: The key of the cell's lease.
            cleared: Whether a person has just said that nobody is in the cell.
            on_lost_client: What happens to a motion whose lease ends.

        Raises:
            ConfigError: It is no request of this kind.
            LockedError: Somebody else has the cell, or another job has its bus open.
            PreflightError: The cell is not ready to move, or nobody has said that it is clear.
            NotAllowedError: Who asks may only look.
        """
        require_role(who, Role.OPERATOR)
        if self.workshop.closing:
            raise LockedError(
                "the service is ending: nothing more is begun", code="RID-SERVICE-ENDING"
            )
        request = paced(kind, request, cell.pace_here())
        of_cells = [path for each in self.cells.values() for path in each.loaded.paths]
        await asyncio.to_thread(check_request, kind, request, self.folder, of_cells)
        approved: dict[str, str] = {}
        if kind.operation.moves:
            approved = await asyncio.to_thread(hashes_of_named, request, self.folder)
        if kind.operation.opens_cell:
            self._require_free(cell, kind, lease, cleared=cleared)
        if kind.operation.moves:  # by the bytes that the preflight counted for
            approved |= {str(path): found for path, found in cell.loaded.hashes.items()}
        held = self.leases.of(cell.name)
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
        return await self.workshop.begin(job, cell, cleared=cleared, approved=approved)

    def stop(self, cell: str, who: str) -> bool:
        """Stop what moves in a cell; return whether something was told to stop."""
        job = self.workshop.stop(cell, f"stopped by {who}")
        if job is None:
            return False
        self.stops += 1
        self.audit.note(who, "stopped", cell, f"job {job.id}")
        return True

    def cancel(self, job: Job, who: Identity) -> None:
        """End a job: one that waits does not begin, one that runs is stopped.

        Raises:
            NotAllowedError: Who asks may only look; a motion is stopped by `stop`, which everybody
                may.
        """
        require_role(who, Role.OPERATOR)
        self.audit.note(who.name, "cancelled", job.cell, f"job {job.id}")
        self.workshop.cancel(job, who.name)

    def answer(self, job: Job, question: int, text: str, who: Identity, lease: str | None) -> None:
        """Answer what a job asks.

        Raises:
            LockedError: It asks nothing of that number now, or who answers does not have the cell.
            NotAllowedError: Who answers may only look.
        """
        require_role(who, Role.OPERATOR)
        running = self.workshop.get(job.id)
        asked = None if running is None else running.question
        if running is None or asked is None or asked.question != question:
            raise LockedError(
                f"job {job.id} does not ask question {question} now", code="RID-JOB-UNKNOWN"
            )
        if job.kind.operation.opens_cell:
            self.leases.require(job.cell, lease)
        self.audit.note(who.name, "answered", job.cell, f"{asked.text} {text}")
        running.order(answer=question, text=text)

    def wanting_keys(self) -> list[str]:
        """Return the jobs that want a key to be held now."""
        return [running.job.id for running in self.workshop if running.wants_key]

    def pass_on_key(self, job_id: str, message: KeyMessage) -> None:
        """Pass a message about a key on to the worker, which judges it; a release at any time."""
        running = self.workshop.get(job_id)
        if running is None or not (running.wants_key or message.is_release):
            return
        running.order_soon(**message.to_order())

    async def run(self, until: asyncio.Event) -> None:
        """Watch jobs and leases until the event; then stop what moves, and end."""
        await self.workshop.prepare()
        beating = asyncio.create_task(self._beat())
        try:
            await self._watch(until)
            await self.workshop.close()
        finally:
            beating.cancel()
        await asyncio.to_thread(self.database.close)

    async def _watch(self, until: asyncio.Event) -> None:
        next_s = 0.0
        while not until.is_set():
            await self.workshop.look()
            if time.monotonic() >= next_s:
                next_s = time.monotonic() + CELLS_S
                for cell in self.cells.values():
                    with self._mishaps.of(f"cell {cell.name}"):
                        self._publish_cell(cell)
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(until.wait(), LOOK_S)

    async def _beat(self) -> None:
        """Give signs of life from the event loop, which tell that it can still answer a STOP."""
        while True:
            with self._mishaps.of("the service's signs of life"):
                self._note_standstill()
                self.workshop.give_signs_of_life()
            await asyncio.sleep(BEAT_S)

    def _note_standstill(self) -> None:
        """Void every preflight after this process has stood still, or the computer has slept.

        What was asked for meanwhile is answered only now: nobody expects it to move the robot.
        """
        now_s, before_s = safety_now_s(), self._beat_s
        self._beat_s = now_s
        if before_s is not None and now_s - before_s > SERVICE_LIMIT_S:
            still = f"the service stood still for {now_s - before_s:.0f} s"
            LOG.warning("%s; preflights count no more", still)
            self.readiness.void_all(f"{still}: check it again.")

    def _require_free(
        self, cell: ServedCell, kind: JobKind, lease: str | None, *, cleared: bool
    ) -> None:
        self._note_standstill()
        cell.look_again()
        self.leases.require(cell.name, lease)
        running = self.workshop.of_cell(cell.name)
        if self.workshop.is_busy(cell.name):
            busy = "a job" if running is None else running.job.kind.value
            raise LockedError(
                f"cell {cell.name}: {busy} is under way: wait for its end, or stop it",
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
                f"cell {cell.name} is real: say that nobody is in it and the emergency stop is at"
                " hand (cleared), each time",
                code="RID-ANSWER-NO",
            )

    def _publish_cell(self, cell: ServedCell) -> None:
        """Tell viewers how a cell is, where that is news."""
        status = self.status(cell).model_dump(mode="json", exclude={"preflight_age_s"})
        told = json.dumps({"type": "cell", "cell": status})
        if self._told.get(cell.name) != told:
            self._told[cell.name] = told
            self.feed.tell(told.encode())


def require_role(who: Identity, role: Role) -> None:
    """Refuse who may not do what a role may.

    Raises:
        NotAllowedError: The role is not enough.
    """
    if not who.role.includes(role):
        raise NotAllowedError(
            f"{who.name} is {who.role.value}: this needs {role.value}", code="RID-ACCESS-ROLE"
        )


def paced(kind: JobKind, request: dict[str, Any], pace: float | None) -> dict[str, Any]:
    """Return a request whose simulated cell keeps the service's pace where it names none."""
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
