"""The list of runs reads a run's files again only after a change."""

from __future__ import annotations

import os
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from unittest.mock import Mock

import pytest

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import MANIFEST
from rid_daq.service.api import run_index
from rid_daq.service.api.run_index import DAMAGED, REPORT, RunIndex

CALLS = 8
Read = list[str]


@pytest.fixture
def read(monkeypatch: pytest.MonkeyPatch) -> Read:
    """Ids of the runs whose files were read."""
    ids: Read = []
    reads = run_index.read_entry

    def noted(folder: RunFolder) -> run_index.RunEntry | None:
        ids.append(folder.run_id)
        return reads(folder)

    monkeypatch.setattr(run_index, "read_entry", noted)
    return ids


@pytest.fixture
def runs(tmp_path: Path) -> list[RunFolder]:
    """Three runs that were last changed an hour ago, oldest first."""
    folders = [RunFolder.create(tmp_path, f"run {i}") for i in range(3)]
    for folder in folders:
        age(folder)
    return folders


def age(folder: RunFolder, seconds: float = 3600.0) -> None:
    """Set the time stamps of a run back by `seconds`."""
    then = time.time() - seconds
    for path in (folder.path / MANIFEST, folder.path):
        os.utime(path, (then, then))


def test_a_second_call_reads_no_run(runs: list[RunFolder], read: Read, tmp_path: Path) -> None:
    index = RunIndex(tmp_path)
    first = index.newest_first()
    assert [each.label for each in first] == ["run 2", "run 1", "run 0"]
    assert len(read) == 3
    assert index.newest_first() == first
    assert len(read) == 3


def test_calls_that_wait_share_one_scan(
    runs: list[RunFolder], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    index, scan = RunIndex(tmp_path), Mock()
    arrived = threading.Barrier(CALLS)

    class Door:
        """Lock that opens when all calls wait for it."""

        lock = threading.Lock()

        def __enter__(self) -> None:
            arrived.wait()
            self.lock.acquire()

        def __exit__(self, *_: object) -> None:
            self.lock.release()

    monkeypatch.setattr(index, "_lock", Door())
    scan.side_effect = index._scan
    monkeypatch.setattr(index, "_scan", scan)
    with ThreadPoolExecutor(CALLS) as pool:
        found = [pool.submit(index.newest_first) for _ in range(CALLS)]
    assert {len(each.result()) for each in found} == {3}
    assert scan.call_count == 1


def test_a_changed_new_or_removed_run_is_noticed(
    runs: list[RunFolder], read: Read, tmp_path: Path
) -> None:
    index = RunIndex(tmp_path)
    index.newest_first()
    read.clear()
    (runs[0].path / REPORT).write_text("<html>")
    (runs[1].path / MANIFEST).write_text("{")
    (runs[2].path / MANIFEST).unlink()
    runs[2].path.rmdir()
    new = RunFolder.create(tmp_path, "new")
    found = {each.id: each for each in index.newest_first()}
    assert sorted(read) == sorted([runs[0].run_id, runs[1].run_id, new.run_id])
    assert found.keys() == {runs[0].run_id, runs[1].run_id, new.run_id}
    assert found[runs[0].run_id].has_report
    assert found[runs[1].run_id].status == DAMAGED
    assert runs[1].run_id in found[runs[1].run_id].problem


def test_a_run_that_was_just_changed_is_read_again(
    runs: list[RunFolder], read: Read, tmp_path: Path
) -> None:
    """Time stamps do not show a change within their resolution."""
    index = RunIndex(tmp_path)
    age(runs[0], seconds=0.5)
    index.newest_first()
    index.newest_first()
    assert read.count(runs[0].run_id) == 2
    assert read.count(runs[1].run_id) == 1


def test_a_link_and_a_copy_are_left_out(runs: list[RunFolder], tmp_path: Path) -> None:
    index = RunIndex(tmp_path)
    last = "1" if runs[1].run_id.endswith("0") else "0"
    runs[1].path.rename(tmp_path / (runs[1].run_id[:-1] + last))  # another run's manifest
    (tmp_path / runs[1].run_id).symlink_to(runs[0].path)
    assert {each.id for each in index.newest_first()} == {runs[0].run_id, runs[2].run_id}
    assert RunIndex(tmp_path / "none").newest_first() == []
