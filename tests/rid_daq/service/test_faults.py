"""Faults, and processes that die during a motion, put the cell into the state FAULT."""

from __future__ import annotations

import asyncio
import json
from dataclasses import replace
from pathlib import Path

import pytest

from acquisition.runs.folder import RunFolder
from acquisition.supervision.stop_reason import StopCode, StopReason
from rid_daq.operations.cell import axis_tester
from rid_daq.operations.cell.axes import OPERATION, AxesRequest
from rid_daq.operations.cell.axis_tester import AxisTestOutcome
from rid_daq.operations.perform import perform
from rid_daq.recording.recorded_run import RecordedRun
from rid_daq.report.result import Result
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.records import CellState, JobState
from rid_daq.service.service import CellService
from rid_daq.terminal.console import Console
from rid_daq.terminal.job_events import MotionEvent
from rid_daq.worker.job_console import EventFile
from tests.rid_daq.recording.test_recorded_run import outcome
from tests.rid_daq.service.conftest import Worker, job

MOTION = MotionEvent(at_s=0.0, run="run-1", title="Axis test.", rows=0, rows_per_period=None)
RUNAWAY = StopReason(StopCode.FOLLOWING_ERROR, "axis1 follows by 0.3 rad, 0.1 rad is allowed.")


@pytest.fixture
def ready_service(service: CellService) -> CellService:
    """Return a service whose cell is ready to move."""
    cell = service.cell("ir361")
    passed = {"passed": True, "lines": [], "files_hash": cell.loaded.files_hash}
    service.readiness.note_check(cell, passed)
    assert service.status(cell).state is CellState.READY
    return service


def test_a_fault_during_the_axis_test_is_a_fault_of_the_cell(
    ready_service: CellService,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    folder = RunFolder.create(tmp_path, "axis test axis1")
    ended = replace(outcome(RUNAWAY), notes=("the power was taken away at once",))
    stopped = RecordedRun(folder, ended, None, None, Result.new("Recording", "arm"), held=True)
    tested = AxisTestOutcome("ir361", (), stopped, None)
    monkeypatch.setattr(axis_tester, "check_axes", lambda _request, _context: tested)
    with pytest.raises(SystemExit):
        perform(OPERATION, AxesRequest(cell="ir361", runs=tmp_path), Console(as_json=True))
    result = json.loads(capsys.readouterr().out)
    assert result["stop"] == {"code": "FOLLOWING_ERROR", "text": RUNAWAY.text}
    assert result["notes"] == ["the power was taken away at once"]
    cell = ready_service.cell("ir361")
    ready_service.readiness.note_end(cell, result)
    status = ready_service.status(cell)
    assert status.state is CellState.FAULT
    assert RUNAWAY.text in status.fault


async def start_and_kill_worker(
    service: CellService, kind: JobKind, worker: Worker, moved: bool
) -> None:
    begun = await service.job_runner.begin(job(kind), service.cell("ir361"), cleared=False)
    if moved:
        with EventFile(service.job_runner.events(begun.id)) as events:
            events.write(MOTION)
    worker.returncode = -9
    await service.job_runner.poll()


def test_a_worker_that_dies_during_a_motion_causes_a_fault(
    ready_service: CellService, worker: Worker
) -> None:
    asyncio.run(start_and_kill_worker(ready_service, JobKind("record"), worker, moved=True))
    status = ready_service.status(ready_service.cell("ir361"))
    assert status.state is CellState.FAULT
    assert "the job's process died (exit code -9)" in status.fault


@pytest.mark.parametrize(("kind", "moved"), [(JobKind("record"), False), (JobKind("check"), False)])
def test_a_worker_that_dies_before_a_motion_causes_no_fault(
    ready_service: CellService, worker: Worker, kind: JobKind, moved: bool
) -> None:
    asyncio.run(start_and_kill_worker(ready_service, kind, worker, moved))
    assert ready_service.status(ready_service.cell("ir361")).state is CellState.READY


def test_an_unfinished_motion_of_a_killed_service_is_a_fault(
    ready_service: CellService,
) -> None:
    left = ready_service.jobs.change(job(JobKind("record")), state=JobState.RUNNING)
    ready_service.jobs.add(left)
    with EventFile(ready_service.job_runner.events(left.id)) as events:
        events.write(MOTION)
    assert ready_service.database.flush(60.0)
    again = CellService(ready_service.folder, list(ready_service.cells.values()))
    status = again.status(again.cell("ir361"))
    assert status.state is CellState.FAULT
    assert "the service was killed" in status.fault
