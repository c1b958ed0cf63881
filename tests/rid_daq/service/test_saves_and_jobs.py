"""A file of a cell cannot change under a job: a save and the start of a job exclude each other."""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest

from config.errors import LockedError
from rid_daq.service.api import files as file_routes
from rid_daq.service.api import plate_zero as zero_routes
from rid_daq.service.files.file_check import check_content
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.records import HeldLease, Identity, Role
from tests.builders.raised_codes import raises_code
from tests.rid_daq.service.conftest import PATIENCE_S, Worker
from tests.rid_daq.service.editing import Editing
from tests.rid_daq.service.test_zero_change import ROUTE, planned, zero_run

ANNA = Identity(name="Anna", role=Role.OPERATOR, person=True, token="Anna")


@pytest.fixture
def editing(tmp_path: Path) -> Editing:
    return Editing(tmp_path)


@pytest.fixture
def lease(editing: Editing) -> HeldLease:
    return editing.service.leases.take("ir361", ANNA, "", 600.0)


class HeldCheck:
    """Check of a file's content that returns only when the test releases it."""

    def __init__(self) -> None:
        self.begun, self.release = threading.Event(), threading.Event()

    def __call__(self, *args: object) -> object:
        found = check_content(*args)  # type: ignore[arg-type]
        self.begun.set()
        assert self.release.wait(PATIENCE_S)
        return found


@pytest.fixture
def held_check(monkeypatch: pytest.MonkeyPatch) -> HeldCheck:
    held = HeldCheck()
    monkeypatch.setattr(file_routes, "check_content", held)
    monkeypatch.setattr(zero_routes, "check_content", held)
    return held


def save_of_a_file(editing: Editing, lease: HeldLease) -> Callable[[], httpx.Response]:
    text, version = editing.text("arm.yaml") + "# checked\n", editing.version("arm.yaml")
    return lambda: editing.save(
        Role.ADMINISTRATOR, "arm.yaml", text, version, x_rid_daq_lease=lease.key
    )


def save_of_a_zero(editing: Editing, lease: HeldLease) -> Callable[[], httpx.Response]:
    run = zero_run(editing.folder, editing.text("cell.yaml").encode())
    body = json.dumps({"run": run, "version": planned(editing, run)["version"]})
    headers = {"content_type": "application/json", "x_rid_daq_lease": lease.key}
    return lambda: editing.ask_api(Role.OPERATOR, "POST", ROUTE, body, **headers)


def begin_check(editing: Editing, lease: HeldLease) -> None:
    cell = editing.service.cell("ir361")
    asyncio.run(editing.service.begin(cell, JobKind("check"), {}, ANNA, lease=lease.key))


@pytest.mark.promise("edited-files")
@pytest.mark.parametrize("save", [save_of_a_file, save_of_a_zero])
def test_no_job_starts_while_a_file_of_its_cell_is_saved(
    editing: Editing,
    lease: HeldLease,
    worker: Worker,
    held_check: HeldCheck,
    save: Callable[[Editing, HeldLease], Callable[[], httpx.Response]],
) -> None:
    answers: list[httpx.Response] = []
    request = save(editing, lease)
    saving = threading.Thread(target=lambda: answers.append(request()))
    saving.start()
    try:
        assert held_check.begun.wait(PATIENCE_S)
        with raises_code(LockedError, "RID-FILE-SAVING", "ir361"):
            begin_check(editing, lease)
    finally:
        held_check.release.set()
        saving.join(PATIENCE_S)
    assert answers[0].is_success, answers[0].text
    begin_check(editing, lease)
    assert editing.service.job_runner.is_busy("ir361")


@pytest.mark.promise("edited-files")
@pytest.mark.parametrize("save", [save_of_a_file, save_of_a_zero])
def test_no_file_of_a_cell_is_saved_while_a_job_runs(
    editing: Editing,
    lease: HeldLease,
    worker: Worker,
    save: Callable[[Editing, HeldLease], Callable[[], httpx.Response]],
) -> None:
    request = save(editing, lease)
    before = {name: editing.text(name) for name in ("arm.yaml", "cell.yaml")}
    begin_check(editing, lease)
    answer = request()
    assert (answer.status_code, answer.json()["code"]) == (409, "RID-JOB-RUNNING")
    assert {name: editing.text(name) for name in before} == before
