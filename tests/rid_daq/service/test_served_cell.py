"""A served cell follows changes of all its files; a check is valid only for the files it read."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from config.errors import ConfigError
from config.load import load_cell
from rid_daq.service.readiness import Readiness
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.service import CellService
from rid_daq.service.store.cells import CellStore
from rid_daq.service.store.database import open_database
from tests.builders.raised_codes import raises_code


@pytest.fixture
def cell_file(tmp_path: Path) -> Path:
    """Return the file of the bundled cell; its robot file is in another folder."""
    files = load_cell("ir361").files
    text = files["cell.yaml"].replace(b"robot: ir361", b"robot: ../robots/r.yaml")
    for name, content in (("cells/cell.yaml", text), ("robots/r.yaml", files["robot.yaml"])):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).write_bytes(content)
    return tmp_path / "cells" / "cell.yaml"


@pytest.fixture
def readiness(tmp_path: Path) -> Readiness:
    store = CellStore(open_database(tmp_path / "service.db"))
    store.add("ir361")
    return Readiness(store)


def halve_velocity_limit(cell_file: Path) -> None:
    """Halve a velocity limit of the robot and change the time stamp of its file."""
    robot = cell_file.parent.parent / "robots" / "r.yaml"
    robot.write_text(robot.read_text().replace("velocity: 2.6", "velocity: 1.3"))
    os.utime(robot, ns=(0, robot.stat().st_mtime_ns + 1))


def check_document(path: Path) -> dict[str, object]:
    """Return the document of a successful check that reads the cell now."""
    files_hash = load_cell(str(path)).files_hash
    return {"passed": True, "problem": None, "lines": [], "files_hash": files_hash}


def test_a_change_of_a_robot_file_in_another_folder_is_detected(cell_file: Path) -> None:
    cell = ServedCell(str(cell_file), 1.0)
    before = cell.loaded.files_hash
    halve_velocity_limit(cell_file)
    assert cell.reload_if_changed().robot.joints[0].limits.velocity == 1.3
    assert cell.loaded.files_hash != before


def test_files_that_turn_the_cell_folder_into_a_run_are_detected(cell_file: Path) -> None:
    cell = ServedCell(str(cell_file), 1.0)
    text = (cell_file.parent.parent / "robots" / "r.yaml").read_text()
    cell_file.with_name("manifest.json").write_text('{"run_id": "a", "files": {}}')
    cell.reload_if_changed()
    cell_file.with_name("robot.yaml").write_text(text.replace("velocity: 2.6", "velocity: 1.3"))
    assert cell.reload_if_changed().files_hash == load_cell(str(cell_file)).files_hash
    assert cell.loaded.robot.joints[0].limits.velocity == 1.3


def test_a_missing_robot_file_is_a_problem_until_it_exists(cell_file: Path) -> None:
    cell = ServedCell(str(cell_file), 1.0)
    robot = cell_file.parent.parent / "robots" / "r.yaml"
    moved = robot.rename(robot.with_name("renamed.yaml"))
    cell_file.write_text(cell_file.read_text().replace("r.yaml", "later.yaml"))
    cell.reload_if_changed()
    assert "later.yaml: cannot read" in cell.problem
    moved.rename(robot.with_name("later.yaml"))
    assert cell.reload_if_changed().paths[1].name == "later.yaml"
    assert cell.problem == ""


def test_a_cell_file_with_a_changed_cell_name_is_not_used(cell_file: Path) -> None:
    cell = ServedCell(str(cell_file), 1.0)
    before = cell.loaded
    cell_file.write_text(cell_file.read_text().replace("name: ir361", "name: other"))
    assert cell.reload_if_changed() is before
    assert "'other'" in cell.problem
    assert "'ir361'" in cell.problem


def test_two_cells_with_the_same_name_are_refused(tmp_path: Path, cell_file: Path) -> None:
    with raises_code(ConfigError, "RID-SERVICE-CELLS"):
        CellService(tmp_path, [ServedCell(str(cell_file), 1.0), ServedCell("ir361", 1.0)])


def test_a_check_is_void_if_files_changed_during_it(cell_file: Path, readiness: Readiness) -> None:
    cell = ServedCell(str(cell_file), 1.0)
    document = check_document(cell_file)
    halve_velocity_limit(cell_file)
    cell.reload_if_changed()
    readiness.note_check(cell, document)
    assert readiness.obstacle(cell).startswith("the cell's files have changed after the preflight")
    readiness.note_check(cell, check_document(cell_file))
    assert readiness.obstacle(cell) == ""


def test_a_check_without_a_hash_of_its_files_is_void(cell_file: Path, readiness: Readiness) -> None:
    cell = ServedCell(str(cell_file), 1.0)
    readiness.note_check(cell, {**check_document(cell_file), "files_hash": None})
    assert readiness.obstacle(cell).startswith("the cell's files have changed after the preflight")
