"""A measured zero of the force plate is written into the cell file, or refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import httpx
import pytest

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from config.cell.plate import PlateZero
from config.errors import ConfigError
from config.load import load_cell
from rid_daq.runs.plate_zero_lines import ZERO_FILE, zero_lines
from rid_daq.service.files.edited_file import EditedFile
from rid_daq.service.files.zero_change import ZeroChange
from rid_daq.service.records import Role
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.service import CellService
from tests.builders.raised_codes import raises_code
from tests.rid_daq.service.editing import Editing

ZERO = PlateZero(offset_n=(1.5, -2.0, 0.0, 0.25, 4.0, 5.0, 6.0, -1250.25), pose=(0.0, -0.2, 0.5))
ROUTE = "cells/ir361/plate-zero"


def zero_run(folder: Path, content: bytes, zero: PlateZero = ZERO, **facts: Any) -> str:
    """Write a run that has measured a zero, and return its id."""
    run = RunFolder.create(folder / "runs", "plate zero")
    run.write("cell.yaml", content)
    run.write(ZERO_FILE, zero_lines(zero, "measured").encode())
    run.finish(RunStatus.COMPLETE, {"robot": "ir361", "cell": "ir361", "zeroed": True, **facts})
    return run.run_id


@pytest.fixture
def editing(tmp_path: Path) -> Editing:
    return Editing(tmp_path)


@pytest.fixture
def run(editing: Editing) -> str:
    return zero_run(editing.folder, editing.text("cell.yaml").encode())


def planned(editing: Editing, run: str) -> Any:
    return editing.ask_api(Role.OPERATOR, "GET", f"{ROUTE}?run={run}").json()


def written(editing: Editing, run: str, version: str, role: Role = Role.OPERATOR) -> httpx.Response:
    body = json.dumps({"run": run, "version": version})
    kind = {"content_type": "application/json"}
    return editing.ask_api(role, "POST", ROUTE, body, **kind)


def outcome(answer: httpx.Response) -> tuple[int, str]:
    return answer.status_code, answer.json().get("code", "")


def test_an_operator_sees_old_and_new_values_and_writes_them(editing: Editing, run: str) -> None:
    before = editing.text("cell.yaml")
    plan = planned(editing, run)
    assert (plan["file"], plan["before"]) == ("cell.yaml", None)
    assert plan["after"]["offset_n"] == list(ZERO.offset_n)
    assert editing.text("cell.yaml") == before
    assert written(editing, run, plan["version"]).status_code == 200
    plate = load_cell(str(editing.folder / "cell.yaml")).config.plate
    assert plate is not None
    assert plate.zero == ZERO
    kept = [line for line in editing.text("cell.yaml").splitlines() if line in before.splitlines()]
    assert kept == before.splitlines()
    assert [each.what for each in editing.service.audit.newest()] == ["wrote a zero"]
    again = zero_run(
        editing.folder, before.encode(), ZERO.model_copy(update={"offset_n": (7.0,) * 8})
    )
    plan = planned(editing, again)
    assert plan["before"]["offset_n"] == list(ZERO.offset_n)
    assert plan["after"]["offset_n"] == [7.0] * 8


def test_the_zero_of_an_older_run_does_not_replace_a_newer_one(editing: Editing, run: str) -> None:
    newer = zero_run(editing.folder, editing.text("cell.yaml").encode())
    assert written(editing, newer, planned(editing, newer)["version"]).status_code == 200
    kept = editing.text("cell.yaml")
    answer = editing.ask_api(Role.OPERATOR, "GET", f"{ROUTE}?run={run}")
    assert outcome(answer)[1] == "RID-PLATE-ZERO-WRITE"
    assert editing.text("cell.yaml") == kept


def test_a_file_that_someone_else_has_changed_is_told(editing: Editing, run: str) -> None:
    version = planned(editing, run)["version"]
    changed = editing.text("cell.yaml") + "# of the other shift\n"
    (editing.folder / "cell.yaml").write_text(changed)
    assert outcome(written(editing, run, version)) == (412, "RID-FILE-CHANGED")
    assert editing.text("cell.yaml") == changed


@pytest.mark.promise("edited-files")
def test_a_held_cell_or_a_viewer_changes_nothing(editing: Editing, run: str) -> None:
    before, version = editing.text("cell.yaml"), planned(editing, run)["version"]
    assert outcome(written(editing, run, version, Role.VIEWER)) == (403, "RID-ACCESS-ROLE")
    with editing.service.file_locks.hold(EditedFile.find(editing.service, "cell.yaml")):
        assert outcome(written(editing, run, version)) == (412, "RID-FILE-CHANGED")
    editing.hold()
    assert outcome(written(editing, run, version)) == (409, "RID-LEASE-OTHER")
    assert editing.text("cell.yaml") == before


@pytest.mark.promise("edited-files")
def test_a_zero_that_does_not_fit_is_refused(editing: Editing) -> None:
    cell = editing.text("cell.yaml")
    other_plate = cell.replace("a_m: 0.120", "a_m: 0.100").encode()
    for run in (
        zero_run(editing.folder, cell.encode(), zeroed=False),
        zero_run(editing.folder, cell.encode(), cell="other"),
        zero_run(editing.folder, other_plate),
    ):
        answer = editing.ask_api(Role.OPERATOR, "GET", f"{ROUTE}?run={run}")
        assert outcome(answer) == (422, "RID-PLATE-ZERO-WRITE")
    changed = zero_run(editing.folder, cell.encode())
    (editing.folder / "runs" / changed / ZERO_FILE).write_text(zero_lines(ZERO, "by hand"))
    answer = editing.ask_api(Role.OPERATOR, "GET", f"{ROUTE}?run={changed}")
    assert outcome(answer) == (422, "RID-RUN-CHANGED")


def test_a_bundled_cell_keeps_no_zero(tmp_path: Path) -> None:
    service = CellService(tmp_path, [ServedCell("ir361", 20.0)])
    run = zero_run(tmp_path, load_cell("ir361").files["cell.yaml"])
    with raises_code(ConfigError, "RID-PLATE-ZERO-WRITE", "ir361"):
        ZeroChange.of(service, service.cell("ir361"), RunFolder.open(tmp_path / "runs" / run))
