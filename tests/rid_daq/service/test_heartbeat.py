"""Lease ends of jobs, a suspended service, and the reasons with which jobs end."""

from __future__ import annotations

import asyncio
import json
import os
import signal
from math import inf
from pathlib import Path

import pytest

from acquisition.supervision.stop_reason import StopCode
from acquisition.task.service_beat import SERVICE_LIMIT_S
from config.errors import PreflightError
from config.process.safety_clock import safety_now_s
from rid_daq.blocks.block import Verdict
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.job_runner import outcome_of_job
from rid_daq.service.records import Identity, Job, JobState, OnLostClient, Role
from rid_daq.service.service import CellService
from rid_daq.service.workers.running_job import EventTail, RunningJob
from rid_daq.service.workers.worker_template import WorkerTemplate
from rid_daq.terminal.job_events import EndEvent, MotionEvent, ResultEvent
from rid_daq.worker.job_console import EventFile
from tests.builders.raised_codes import raises_code
from tests.rid_daq.service.conftest import PATIENCE_S, Worker, as_worker, has_handler, job

ANNA = Identity(name="Anna", role=Role.OPERATOR, person=True, token="a")


def start_job(service: CellService, kind: JobKind, policy: OnLostClient, lease: str | None) -> Job:
    """Start a job that was requested with a lease, or without one."""
    new_job = job(kind).model_copy(update={"lease": lease, "on_lost_client": policy})
    return asyncio.run(service.job_runner.begin(new_job, service.cell("ir361"), cleared=False))


def lease_end_s(service: CellService) -> float:
    (running,) = service.job_runner
    service.job_runner.send_heartbeats()
    end_s: float = running.process.beat._words.lease_end_s
    return end_s


@pytest.mark.promise("service-heartbeat")
@pytest.mark.parametrize(
    ("kind", "policy"),
    [(JobKind("record"), "finish"), (JobKind("check"), "stop"), (JobKind("identify"), "stop")],
)
def test_a_job_that_continues_without_its_client_has_no_lease_end(
    service: CellService, worker: Worker, kind: JobKind, policy: OnLostClient
) -> None:
    start_job(service, kind, policy, None)
    assert lease_end_s(service) == inf
    (running,) = service.job_runner
    assert running.process.beat.reason(safety_now_s()) is None
    silent = running.process.beat.reason(safety_now_s() + SERVICE_LIMIT_S + 1.0)
    assert silent is not None
    assert silent.code is StopCode.SERVICE_LOST


@pytest.mark.promise("service-heartbeat")
def test_a_motion_is_permitted_as_long_as_its_lease(service: CellService, worker: Worker) -> None:
    lease = service.leases.take("ir361", ANNA, "", 60.0)
    start_job(service, JobKind("record"), "stop", lease.id)
    first_s = lease_end_s(service)
    assert 50.0 < first_s - safety_now_s() <= 60.0
    service.leases.renew("ir361", lease.key, 600.0)
    assert lease_end_s(service) > first_s + 500.0
    service.leases.take("ir361", ANNA, "", 60.0, confirmed="ir361")
    assert lease_end_s(service) == -inf, "another lease has the cell"
    (running,) = service.job_runner
    lost = running.process.beat.reason(safety_now_s())
    assert lost is not None
    assert lost.code is StopCode.CLIENT_LOST


@pytest.mark.promise("service-heartbeat")
def test_after_a_pause_of_the_service_a_new_preflight_is_required(
    service: CellService, monkeypatch: pytest.MonkeyPatch
) -> None:
    cell = service.cell("ir361")
    passed = {"passed": True, "lines": [], "files_hash": cell.loaded.files_hash}
    lease = service.leases.take("ir361", ANNA, "", 600.0)

    async def begin() -> None:
        await service.begin(cell, JobKind("jog"), {}, ANNA, lease=lease.key)

    service._void_preflights_after_pause()
    service.readiness.note_check(cell, passed)
    monkeypatch.setattr(
        "rid_daq.service.service.safety_now_s", lambda: safety_now_s() + SERVICE_LIMIT_S + 1.0
    )
    with raises_code(PreflightError, "RID-CELL-NOT-READY") as refused:
        asyncio.run(begin())
    assert refused.value.refusal == "RID-CELL-NOT-READY"


@pytest.mark.promise("stop-has-its-reason")
@pytest.mark.parametrize("code", [-signal.SIGTERM, 128 + signal.SIGTERM])
def test_a_stop_before_the_worker_reports_has_the_right_reason(
    service: CellService, tmp_path: Path, code: int
) -> None:
    worker = Worker()
    running = RunningJob(job(), service.cell("ir361"), as_worker(worker), tmp_path / "events")
    running.stop("stopped by Anna", StopCode.STOP_BUTTON)
    worker.returncode = code
    assert outcome_of_job(running, closing=False) == (JobState.STOPPED, "stopped by Anna")
    assert outcome_of_job(running, closing=True) == (JobState.INTERRUPTED, "stopped by Anna")


@pytest.mark.promise("stop-has-its-reason")
@pytest.mark.parametrize(
    ("stopped", "moved", "code"),
    [(False, False, -15), (True, True, -15), (True, False, -9), (True, False, 1)],
)
def test_a_process_that_died_without_a_stop_is_reported_as_died(
    service: CellService, tmp_path: Path, stopped: bool, moved: bool, code: int
) -> None:
    worker = Worker()
    running = RunningJob(job(), service.cell("ir361"), as_worker(worker), tmp_path / "events")
    if moved:
        with EventFile(tmp_path / "events") as events:
            begins = MotionEvent(at_s=0.0, run="1", title="", rows=0, rows_per_period=None)
            events.write(begins)
        running.read_events()
    if stopped:
        running.stop("stopped by Anna", StopCode.STOP_BUTTON)
    worker.returncode = code
    state, reason = outcome_of_job(running, closing=False)
    assert state is JobState.INTERRUPTED
    assert f"the job's process died (exit code {code})" in reason


def test_the_reason_of_a_job_is_the_failed_verdict_of_its_result(
    service: CellService, tmp_path: Path
) -> None:
    worker = Worker()
    running = RunningJob(job(), service.cell("ir361"), as_worker(worker), tmp_path / "events")
    blocks = (
        Verdict(passed=True, text="axis1: good"),
        Verdict(passed=False, text="Failed: axis2: late"),
    )
    with EventFile(tmp_path / "events") as events:
        events.write(ResultEvent(at_s=0.0, document={"run": "r1"}, blocks=blocks))
        events.write(EndEvent(at_s=0.0, exit_code=1))
    running.read_events()
    worker.returncode = 1
    assert outcome_of_job(running, closing=False) == (JobState.FAILED, "axis2: late")
    assert running.document == {"run": "r1"}


@pytest.mark.promise("stop-has-its-reason")
def test_a_worker_terminated_during_its_imports_reports_it(tmp_path: Path) -> None:
    order = {
        "kind": "record",
        "request": {"motion": "none.yaml"},
        "cell": "ir361",
        "runs": str(tmp_path),
        "folder": str(tmp_path),
        "events": str(tmp_path / "events"),
        "cleared": False,
        "service": os.getpid(),
    }

    async def ended() -> int | None:
        template = WorkerTemplate(tmp_path / "log")
        worker = await template.start_worker()
        worker.beat.write(safety_now_s(), inf)
        worker.stdin.write(json.dumps(order).encode() + b"\n")
        while not has_handler(worker.pid, signal.SIGTERM):
            await asyncio.sleep(0.001)
        worker.terminate()
        await asyncio.wait_for(worker.wait(), PATIENCE_S)
        await template.end()
        return worker.returncode

    assert asyncio.run(ended()) == 128 + signal.SIGTERM
    assert (tmp_path / "log").read_bytes() == b""
    *_, last = EventTail(tmp_path / "events").read_new()
    assert isinstance(last, EndEvent)
    assert last.error == "Terminated"
