"""A service trusts its state folder only if no other user could have made or changed it."""

from __future__ import annotations

import contextlib
import os
import sqlite3
from collections.abc import Callable
from pathlib import Path

import pytest

from config.errors import RecordingError
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.service import CellService
from rid_daq.service.store.database import open_database
from rid_daq.service.store.state_folder import STATE_FOLDER, open_state_folder
from tests.builders.raised_codes import raises_code

NOBODY = 65534
as_root = pytest.mark.skipif(os.geteuid() != 0, reason="needs root, for a second user's files")

Change = Callable[[Path], None]


def _state_of_another_user(state: Path) -> None:
    os.chown(state, NOBODY, NOBODY)


def _database_of_another_user(state: Path) -> None:
    os.chown(state / "service.db", NOBODY, NOBODY)


def _journal_of_another_user(state: Path) -> None:
    journal = state / "jobs" / "one.jsonl"
    journal.touch()
    os.chown(journal, NOBODY, NOBODY)


def _parent_of_another_user(state: Path) -> None:
    os.chown(state.parent, NOBODY, NOBODY)


def _parent_writable_by_everybody(state: Path) -> None:
    state.parent.chmod(0o777)


def _state_open_to_others(state: Path) -> None:
    state.chmod(0o755)


def _database_writable_by_everybody(state: Path) -> None:
    (state / "service.db").chmod(0o666)


def _state_behind_a_link(state: Path) -> None:
    state.rename(state.with_name("elsewhere"))
    state.symlink_to("elsewhere")


def _database_behind_a_link(state: Path) -> None:
    database = state / "service.db"
    database.rename(state.parent / "elsewhere.db")
    database.symlink_to(state.parent / "elsewhere.db")


@pytest.mark.promise("own-state")
@pytest.mark.parametrize(
    "change",
    [
        pytest.param(_state_of_another_user, marks=as_root),
        pytest.param(_database_of_another_user, marks=as_root),
        pytest.param(_journal_of_another_user, marks=as_root),
        pytest.param(_parent_of_another_user, marks=as_root),
        _parent_writable_by_everybody,
        _state_open_to_others,
        _database_writable_by_everybody,
        _state_behind_a_link,
        _database_behind_a_link,
    ],
)
def test_state_that_another_user_could_have_made_is_refused(tmp_path: Path, change: Change) -> None:
    folder = tmp_path / "served"
    folder.mkdir(mode=0o755)
    CellService(folder, [ServedCell("ir361", 20.0)]).database.close()
    change(folder / STATE_FOLDER)
    with pytest.raises(RecordingError) as refused:
        CellService(folder, [ServedCell("ir361", 20.0)])
    assert refused.value.refusal == "RID-STATE-NOT-PRIVATE"


def test_a_sticky_shared_folder_is_accepted(tmp_path: Path) -> None:
    tmp_path.chmod(0o1777)
    assert open_state_folder(tmp_path).stat().st_mode & 0o777 == 0o700
    assert open_state_folder(tmp_path).name == STATE_FOLDER


def test_a_database_of_another_format_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "service.db"
    with contextlib.closing(sqlite3.connect(path)) as other:
        other.execute("PRAGMA user_version = 1")
    with raises_code(RecordingError, "RID-FILE-FORMAT"):
        open_database(path)


def test_a_file_that_is_not_a_database_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "service.db"
    path.write_bytes(b"not SQLite" * 200)
    with raises_code(RecordingError, "RID-STATE-DAMAGED", str(path)):
        open_database(path)
