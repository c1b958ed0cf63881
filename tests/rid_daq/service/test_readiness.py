"""Condition for a motion: a recent and complete preflight by this service."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import pytest

from acquisition.motion.known_pose import MOVED
from rid_daq.preflight.axis_test import UNTESTED
from rid_daq.preflight.check_line import CheckLine
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.readiness import NOT_SINCE_START, PREFLIGHT_LIMIT_S, Readiness
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.store.cells import CellStore
from rid_daq.service.store.database import open_database
from tests.builders.clock import Clock


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def cell() -> ServedCell:
    return ServedCell("ir361", 1.0)


def open_readiness(folder: Path, clock: Clock) -> Readiness:
    """Return the readiness of a service that starts now."""
    store = CellStore(open_database(folder / "service.db"))
    store.add("ir361")
    return Readiness(store, clock)


@pytest.fixture
def readiness(tmp_path: Path, clock: Clock) -> Readiness:
    return open_readiness(tmp_path, clock)


def check_document(cell: ServedCell, *red: str, problem: str | None = None) -> dict[str, object]:
    """Return the document of a check with red lines."""
    lines = [CheckLine("axis1, node 1", "", "", "", "red", code=code) for code in red]
    lines.append(CheckLine("axis1, node 1", "", "", "", "ok"))
    return {
        "passed": not red and problem is None,
        "problem": problem,
        "lines": [asdict(line) for line in lines],
        "files_hash": cell.loaded.files_hash,
    }


@pytest.mark.promise("safety-clock")
def test_a_jump_of_the_date_neither_extends_nor_voids_a_preflight(
    cell: ServedCell, readiness: Readiness, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    readiness.note_check(cell, check_document(cell))
    for date_s in (0.0, 4e9):
        monkeypatch.setattr("time.time", lambda date_s=date_s: date_s)
        assert readiness.obstacle(cell) == ""
    clock.now_s += PREFLIGHT_LIMIT_S + 1.0
    assert readiness.obstacle(cell).startswith("the preflight is 30 min old")
    assert readiness.age_s(cell) == PREFLIGHT_LIMIT_S + 1.0


@pytest.mark.promise("safety-clock")
def test_a_restart_of_the_service_voids_a_preflight(
    cell: ServedCell, tmp_path: Path, clock: Clock
) -> None:
    database = open_database(tmp_path / "service.db")
    store = CellStore(database)
    store.add("ir361")
    Readiness(store, clock).note_check(cell, check_document(cell))
    database.close()
    again = open_readiness(tmp_path, clock)
    assert again.obstacle(cell) == NOT_SINCE_START
    document = again.preflight(cell)
    assert document is not None
    assert document.passed, "its lines can still be read"
    assert document.void_because == NOT_SINCE_START
    assert document.age_s is None


@pytest.mark.promise("served-axis-test")
@pytest.mark.parametrize("kind", [kind for kind in JobKind if kind.operation.moves])
def test_only_axis_test_and_jog_are_allowed_without_an_axis_test(
    kind: JobKind, cell: ServedCell, readiness: Readiness
) -> None:
    readiness.note_check(cell, check_document(cell, UNTESTED))
    held = kind in (JobKind("axes"), JobKind("jog"))
    assert (readiness.obstacle(cell, kind) == "") is held
    assert "preflight has failed" in readiness.obstacle(cell)


@pytest.mark.parametrize("kind", [kind for kind in JobKind if kind.operation.moves])
def test_a_robot_in_an_unexpected_pose_moves_only_with_a_held_key(
    kind: JobKind, cell: ServedCell, readiness: Readiness
) -> None:
    readiness.note_check(cell, check_document(cell, MOVED))
    held = kind in (JobKind("axes"), JobKind("jog"))
    assert (readiness.obstacle(cell, kind) == "") is held


@pytest.mark.promise("served-axis-test")
@pytest.mark.parametrize("kind", [JobKind("axes"), JobKind("jog")])
def test_any_other_red_line_also_prevents_axis_test_and_jog(
    kind: JobKind, cell: ServedCell, readiness: Readiness, clock: Clock
) -> None:
    readiness.note_check(cell, check_document(cell, UNTESTED, ""))
    assert "preflight has failed" in readiness.obstacle(cell, kind)
    readiness.note_check(cell, check_document(cell, ""))
    assert "preflight has failed" in readiness.obstacle(cell, kind)
    readiness.note_check(cell, check_document(cell, UNTESTED, problem="a drive is silent"))
    assert "preflight has failed" in readiness.obstacle(cell, kind)
    readiness.note_check(cell, check_document(cell, problem="a drive is silent"))
    assert "preflight has failed" in readiness.obstacle(cell, kind)
    readiness.note_check(cell, check_document(cell, UNTESTED))
    clock.now_s += PREFLIGHT_LIMIT_S + 1.0
    assert "min old" in readiness.obstacle(cell, kind)
