"""An error of one cell, job or worker does not end the service."""

from __future__ import annotations

import asyncio
import logging
import sqlite3
from pathlib import Path
from typing import Any, cast

import pytest

from acquisition.supervision.stop_reason import StopCode
from acquisition.task.service_beat import ServiceBeat
from config.load import load_cell
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.records import CellState, Job, JobState
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.service import CellService
from rid_daq.service.workers.running_job import RunningJob
from rid_daq.service.workers.worker_template import WorkerTemplate
from rid_daq.terminal.job_events import AnyEvent
from tests.rid_daq.service.conftest import ClosedInput


class Worker:
    """Replacement of a job's process, with the attributes that the job runner uses."""

    pid = 1
    returncode: int | None = None
    stdin = ClosedInput()

    def __init__(self) -> None:
        self.beat = ServiceBeat.create()


class BrokenJob(RunningJob):
    """A job whose events cannot be read."""

    codes: tuple[StopCode, ...] = ()

    def read_events(self) -> list[AnyEvent]:
        raise OSError(5, "Input/output error")

    def stop(self, why: str, code: StopCode) -> None:
        self.stopping, self.codes = why, (*self.codes, code)


def start_job(service: CellService, kind: type[RunningJob], worker: Worker) -> Any:
    """Return a running job of a class; the service monitors it like a started one."""
    job = Job(
        id="1",
        cell="ir361",
        kind=JobKind("record"),
        state=JobState.RUNNING,
        owner="Anna",
        request={},
        on_lost_client="finish",
        created_s=0.0,
    )
    service.jobs.add(job)
    events = service.job_runner.events(job.id)
    running = kind(job, service.cell("ir361"), cast("Any", worker), events)
    service.job_runner._running[job.id] = running
    return running


@pytest.fixture(autouse=True)
def no_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make the start of every worker fail."""

    async def start(_self: WorkerTemplate) -> None:
        raise BlockingIOError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(WorkerTemplate, "_start", start)


@pytest.mark.parametrize("error", [RuntimeError("a mistake"), sqlite3.OperationalError("full")])
def test_an_error_of_one_cell_does_not_end_the_service(
    error: Exception, service: CellService, monkeypatch: pytest.MonkeyPatch, caplog: Any
) -> None:
    until = asyncio.Event()
    cells_checked = []

    def status(cell: ServedCell) -> None:
        cells_checked.append(cell.name)
        if len(cells_checked) == 3:
            until.set()
        raise error

    monkeypatch.setattr(service, "status", status)
    with caplog.at_level(logging.ERROR, "rid_daq.service"):
        asyncio.run(service.run(until))
    messages = [record.message for record in caplog.records]
    assert messages == [
        "template of the workers: unexpected error; the service continues",
        "cell ir361: unexpected error; the service continues",
    ]


def test_a_job_that_cannot_be_monitored_is_stopped_once(service: CellService) -> None:
    running = start_job(service, BrokenJob, Worker())
    for _ in range(3):
        asyncio.run(service.job_runner.poll())
    assert running.codes == (StopCode.INTERRUPTED,)
    why = "the service could not supervise the job: see the service's log"
    assert running.stopping == why


def test_the_end_of_a_job_is_written_when_the_disk_has_space_again(
    service: CellService, monkeypatch: pytest.MonkeyPatch
) -> None:
    worker = Worker()
    start_job(service, RunningJob, worker)
    worker.returncode = 0

    def full(*_: object, **_more: object) -> None:
        raise sqlite3.OperationalError("database or disk is full")

    with monkeypatch.context() as patched:
        patched.setattr(service.jobs, "change", full)
        asyncio.run(service.job_runner.poll())
    assert service.job("1").state is JobState.RUNNING
    assert service.job_runner.is_busy("ir361")
    asyncio.run(service.job_runner.poll())
    assert service.job("1").state is JobState.INTERRUPTED
    assert not service.job_runner.is_busy("ir361")


def test_a_cell_with_a_deleted_folder_is_not_ready(tmp_path: Path) -> None:
    folder = tmp_path / "cell"
    folder.mkdir()
    (folder / "cell.yaml").write_bytes(load_cell("ir361").files["cell.yaml"])
    cell = ServedCell(str(folder / "cell.yaml"), 1.0)
    service = CellService(tmp_path, [cell])
    folder.rename(tmp_path / "away")
    cell.reload_if_changed()
    status = service.status(cell)
    assert status.state is CellState.CLOSED
    assert "the cell's files have errors" in status.not_ready_because
    assert "cell.yaml: cannot read" in status.not_ready_because
    (tmp_path / "away").rename(folder)
    cell.reload_if_changed()
    assert (
        service.status(cell).not_ready_because
        == "the cell has had no preflight yet: check the cell."
    )
