"""A job is stopped while no motion runs: between two motions, or while its worker starts."""

from __future__ import annotations

import asyncio
from pathlib import Path
from types import SimpleNamespace

import pytest

from acquisition.supervision.stop_reason import StopCode
from acquisition.task.control_block import ControlBlock
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.records import Identity, Job, JobState, Role
from rid_daq.service.service import CellService
from rid_daq.service.workers.running_job import RunningJob
from rid_daq.terminal.job_events import QuestionEvent
from tests.rid_daq.service.conftest import Worker, as_worker, job

WHO = Identity(name="anna", role=Role.OPERATOR, person=True, token="")


def test_a_stop_between_two_motions_stops_the_next_motion(
    service: CellService, worker: Worker
) -> None:
    async def stopped() -> None:
        await service.job_runner.begin(job(), service.cell("ir361"), cleared=False)
        first = ControlBlock.create()
        assert service.stop("ir361", "anna")
        assert first.program.stop_code == StopCode.STOP_BUTTON
        first.program.declare_task_gone()
        second = ControlBlock.create()
        await service.job_runner.poll()
        assert second.program.stop_code == StopCode.STOP_BUTTON
        second.program.declare_task_gone()

    asyncio.run(stopped())
    assert worker.terminated == 0  # the worker can still write its recording


def test_a_motion_without_a_stop_request_is_not_stopped(
    service: CellService, worker: Worker
) -> None:
    async def looked_at() -> None:
        await service.job_runner.begin(job(), service.cell("ir361"), cleared=False)
        motion = ControlBlock.create()
        await service.job_runner.poll()
        assert not motion.program.stop_code
        motion.program.declare_task_gone()

    asyncio.run(looked_at())


def test_a_stop_after_the_end_of_the_motion_is_followed_by_a_signal(
    service: CellService, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    worker = Worker()
    running = RunningJob(job(), service.cell("ir361"), as_worker(worker), tmp_path / "events")
    over = SimpleNamespace(program=SimpleNamespace(request_stop=lambda _code: None), task_gone=True)
    monkeypatch.setattr(running, "_find_control", lambda: over)
    running.stop("stopped by anna", StopCode.STOP_BUTTON)
    assert worker.terminated == 1


def test_a_job_stopped_while_its_worker_starts_does_not_run(
    service: CellService, worker: Worker
) -> None:
    async def stopped() -> Job:
        begun = asyncio.create_task(
            service.job_runner.begin(job(), service.cell("ir361"), cleared=False)
        )
        await asyncio.sleep(0)
        assert service.job_runner.is_busy("ir361")
        assert service.stop("ir361", "anna")
        return await begun

    over = asyncio.run(stopped())
    assert (over.state, over.reason) == (JobState.STOPPED, "stopped by anna before it started")
    assert list(service.job_runner) == []
    assert not service.job_runner.is_busy("ir361")
    assert worker.returncode is not None


def test_a_computing_job_cancelled_while_its_worker_starts_does_not_run(
    service: CellService, worker: Worker
) -> None:
    async def cancelled() -> Job | None:
        begun = asyncio.create_task(
            service.job_runner.begin(job(JobKind("identify")), service.cell("ir361"), cleared=False)
        )
        await asyncio.sleep(0)
        service.cancel(job(JobKind("identify")), WHO)
        return await begun

    over = asyncio.run(cancelled())
    assert over is not None
    assert (over.state, over.reason) == (JobState.STOPPED, "cancelled by anna before it started")
    assert list(service.job_runner) == []


def test_a_cell_moves_only_during_the_motions_of_a_job(
    service: CellService, worker: Worker, tmp_path: Path
) -> None:
    """Between them the job waits for an answer, or the next motion can begin at any time."""
    running = RunningJob(job(), service.cell("ir361"), as_worker(worker), tmp_path / "events")
    states = [running.cell_state]
    motion = ControlBlock.create()
    states.append(running.cell_state)
    running.question = QuestionEvent(at_s=0.0, question=1, form="hold", text="")
    motion.program.declare_task_gone()
    states.append(running.cell_state)
    running.question = QuestionEvent(at_s=0.0, question=2, form="yes_no", text="Attached?")
    states.append(running.cell_state)
    running.stop("stopped by Anna", StopCode.STOP_BUTTON)
    states.append(running.cell_state)
    assert states == ["at rest", "moving", "moving", "waiting", "stopping"]
