"""Conditions for starting a job, for answering its questions, and for stopping its motion."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path

import pytest

from acquisition.supervision.stop_reason import StopCode
from acquisition.task.control_block import ControlBlock
from config.errors import LockedError, PreflightError
from config.load import load_cell
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.records import HeldLease, Identity, Role
from rid_daq.service.refusals import NotAllowedError
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.service import CellService
from rid_daq.service.workers.running_job import RunningJob
from rid_daq.terminal.job_events import QuestionEvent
from tests.builders.raised_codes import raises_code
from tests.rid_daq.service.conftest import Worker, job

ANNA = Identity(name="Anna", role=Role.OPERATOR, person=True, token="a")
VIEWER = Identity(name="screen", role=Role.VIEWER, person=True, token="v")


@pytest.fixture
def lease(service: CellService) -> HeldLease:
    cell = service.cell("ir361")
    checked = {"passed": True, "lines": [], "files_hash": cell.loaded.files_hash}
    service.readiness.note_check(cell, checked)
    return service.leases.take("ir361", ANNA, "", 600.0)


def jog(service: CellService, lease: HeldLease, who: Identity = ANNA) -> None:
    begun = service.begin(service.cell("ir361"), JobKind("jog"), {}, who, lease=lease.key)
    asyncio.run(begun)


def start_motion(service: CellService, lease: HeldLease) -> RunningJob:
    """Start a motion whose worker is this process."""
    new_job = job(JobKind("record")).model_copy(
        update={"lease": lease.id, "on_lost_client": "stop"}
    )
    asyncio.run(service.job_runner.begin(new_job, service.cell("ir361"), cleared=False))
    (begun,) = service.job_runner
    return begun


def test_a_motion_starts_if_all_conditions_are_met(
    service: CellService, worker: Worker, lease: HeldLease
) -> None:
    jog(service, lease)
    assert service.job_runner.is_busy("ir361")


def test_a_service_that_is_ending_starts_no_job(service: CellService, lease: HeldLease) -> None:
    service.job_runner.closing = True
    with raises_code(LockedError, "RID-SERVICE-ENDING"):
        jog(service, lease)


def test_a_viewer_cannot_start_a_job_even_with_a_lease(
    service: CellService, lease: HeldLease
) -> None:
    with raises_code(NotAllowedError, "RID-ACCESS-ROLE"):
        jog(service, lease, VIEWER)


def test_a_motion_without_the_lease_is_refused(service: CellService, lease: HeldLease) -> None:
    service.leases.give_back("ir361", lease.key)
    with raises_code(LockedError, "RID-LEASE-NONE"):
        jog(service, lease)


def test_a_second_job_of_a_cell_is_refused(
    service: CellService, worker: Worker, lease: HeldLease
) -> None:
    start_motion(service, lease)
    with raises_code(LockedError, "RID-JOB-RUNNING"):
        jog(service, lease)


def test_a_real_cell_must_be_cleared_for_each_motion(
    service: CellService, lease: HeldLease, monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded = service.cell("ir361").loaded
    real = replace(loaded, config=loaded.config.model_copy(update={"simulated": False}))
    monkeypatch.setattr(ServedCell, "loaded", real)
    monkeypatch.setattr(ServedCell, "reload_if_changed", lambda _: real)
    with raises_code(PreflightError, "RID-ANSWER-NO"):
        jog(service, lease)


def test_a_change_of_a_cell_file_voids_the_preflight_at_once(tmp_path: Path) -> None:
    for name, content in load_cell("ir361").files.items():
        (tmp_path / name).write_bytes(content)
    file = tmp_path / "cell.yaml"
    file.write_text(file.read_text().replace("robot: ir361", "robot: robot.yaml"))
    service = CellService(tmp_path, [ServedCell(str(file), 20.0)])
    cell = service.cell("ir361")
    checked = {"passed": True, "lines": [], "files_hash": cell.reload_if_changed().files_hash}
    service.readiness.note_check(cell, checked)
    lease = service.leases.take("ir361", ANNA, "", 600.0)
    file.write_text(file.read_text() + "# changed\n")
    with raises_code(PreflightError, "RID-CELL-NOT-READY"):
        jog(service, lease)


def ask_question(begun: RunningJob) -> None:
    begun.question = QuestionEvent(at_s=0.0, question=3, form="yes_no", text="Mounted?")


def test_only_the_lease_owner_can_answer_and_only_the_open_question(
    service: CellService, worker: Worker, lease: HeldLease
) -> None:
    begun = start_motion(service, lease)
    with raises_code(LockedError, "RID-JOB-UNKNOWN"):
        service.answer(begun.job, 3, "y", ANNA, lease.key)
    ask_question(begun)
    with raises_code(LockedError, "RID-JOB-UNKNOWN"):
        service.answer(begun.job, 2, "y", ANNA, lease.key)
    with raises_code(LockedError, "RID-LEASE-OTHER"):
        service.answer(begun.job, 3, "y", ANNA, "another")
    with raises_code(NotAllowedError, "RID-ACCESS-ROLE"):
        service.answer(begun.job, 3, "y", VIEWER, lease.key)
    service.answer(begun.job, 3, "y", ANNA, lease.key)


def test_a_motion_whose_lease_was_returned_is_stopped(
    service: CellService, worker: Worker, lease: HeldLease
) -> None:
    begun = start_motion(service, lease)
    control = ControlBlock.create()
    service.leases.give_back("ir361", lease.key)
    asyncio.run(service.job_runner.poll())
    assert control.program.stop_code == StopCode.CLIENT_LOST
    assert begun.stopping == "anna has lost the lease of the cell"
    control.program.declare_task_gone()


def test_a_service_that_ends_stops_its_motions(
    service: CellService, worker: Worker, lease: HeldLease, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rid_daq.service.job_runner.END_PATIENCE_S", 0.0)
    start_motion(service, lease)
    control = ControlBlock.create()
    asyncio.run(service.job_runner.close())
    assert control.program.stop_code == StopCode.INTERRUPTED
    control.program.declare_task_gone()


def test_a_stop_before_the_motion_ends_the_process_of_the_job(
    service: CellService, worker: Worker, lease: HeldLease
) -> None:
    start_motion(service, lease)
    assert service.stop("ir361", "anna")
    assert worker.terminated == 1
