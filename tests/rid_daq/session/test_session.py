from __future__ import annotations

import multiprocessing
import os
from multiprocessing.connection import Connection
from pathlib import Path

import pytest

from acquisition.runs.folder import RunFolder
from config.cell.cell import CellConfig
from config.errors import LockedError, RecordingError
from config.load import load_cell
from config.process.file_locks import file_holder
from rid_daq.session.session import as_label, hold_cell, mark_unfinished
from tests.builders.raised_codes import raises_code


@pytest.fixture
def cell() -> CellConfig:
    return load_cell("ir361").config


def _hold(cell: CellConfig, folder: Path, line: Connection) -> None:
    with hold_cell(cell, folder):
        line.send("held")
        line.recv()


def test_a_second_session_on_a_bus_is_refused_with_the_holder(
    cell: CellConfig, tmp_path: Path
) -> None:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    other = context.Process(target=_hold, args=(cell, tmp_path, theirs))
    other.start()
    try:
        assert ours.recv() == "held"
        with (
            raises_code(LockedError, "RID-CELL-BUSY", f"process {other.pid}"),
            hold_cell(cell, tmp_path),
        ):
            pass
        renamed = cell.model_copy(update={"name": "the_same_bus_under_another_name"})
        with pytest.raises(LockedError), hold_cell(renamed, tmp_path):
            pass
    finally:
        other.kill()
        other.join()
    with hold_cell(cell, tmp_path):
        pass  # the operating system released it when the other process ended


def test_sessions_on_two_buses_are_independent(cell: CellConfig, tmp_path: Path) -> None:
    second = cell.model_copy(update={"can": cell.can.model_copy(update={"channel": "other"})})
    with hold_cell(cell, tmp_path), hold_cell(second, tmp_path):
        assert len([*tmp_path.glob("*.lock")]) == 2
    assert os.listdir(tmp_path) == [], "all lock files are deleted"


def test_the_lock_is_released_after_the_with_block(cell: CellConfig, tmp_path: Path) -> None:
    for _ in range(2):
        with hold_cell(cell, tmp_path):
            (lock,) = tmp_path.glob("*.lock")
            assert file_holder(lock) == os.getpid()
        assert not lock.exists()


def test_a_missing_lock_folder_is_a_storage_error(cell: CellConfig, tmp_path: Path) -> None:
    missing = tmp_path / "missing"
    with raises_code(RecordingError, "RID-FILE-ACCESS"), hold_cell(cell, missing):
        pass


def test_a_symbolic_link_is_not_followed(cell: CellConfig, tmp_path: Path) -> None:
    with hold_cell(cell, tmp_path):
        (lock,) = tmp_path.glob("*.lock")
    lock.symlink_to(tmp_path / "victim")
    with pytest.raises(RecordingError), hold_cell(cell, tmp_path):
        pass
    assert not (tmp_path / "victim").exists()


def test_a_failed_run_stores_the_reason(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path, "test")
    with pytest.raises(RecordingError), mark_unfinished(folder):
        raise RecordingError("the disk is full")
    manifest = folder.manifest()
    assert manifest.status == "stopped"
    assert manifest.facts == {"why": "the disk is full"}


def test_any_file_name_becomes_a_valid_label() -> None:
    assert as_label("my motion (2)") == "my motion _2_"
    label = as_label("../" * 40)
    assert "/" not in label
    assert len(label) <= 64


def test_a_file_called_latest_gets_another_label(tmp_path: Path) -> None:
    assert RunFolder.create(tmp_path, as_label("latest")).manifest().label == "latest_"
