"""Atomic file writing: the new file is complete, or the old one is unchanged."""

from __future__ import annotations

import os
import random
from collections.abc import Callable
from pathlib import Path

import pytest

from config.errors import RecordingError
from config.formats.whole_file import write_whole
from tests.builders.raised_codes import raises_code


def test_a_file_is_replaced_completely_without_temporary_files(tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    write_whole(path, b"first")
    write_whole(path, b"second")
    assert path.read_bytes() == b"second"
    assert [item.name for item in tmp_path.iterdir()] == ["model.json"]


def test_a_missing_folder_is_a_storage_error(tmp_path: Path) -> None:
    with raises_code(RecordingError, "RID-FILE-WRITE", "model.json"):
        write_whole(tmp_path / "missing" / "model.json", b"{}")


def test_a_link_in_place_of_the_temporary_file_is_not_followed(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_bytes(b"untouched")
    (tmp_path / f"model.json.{os.getpid()}.tmp").symlink_to(victim)
    write_whole(tmp_path / "model.json", b"new")
    assert victim.read_bytes() == b"untouched"
    assert (tmp_path / "model.json").read_bytes() == b"new"


def test_a_link_is_kept_and_its_target_replaced(tmp_path: Path) -> None:
    (tmp_path / "link.json").symlink_to("model.json")
    write_whole(tmp_path / "link.json", b"new")
    assert (tmp_path / "link.json").is_symlink()
    assert (tmp_path / "model.json").read_bytes() == b"new"


def test_a_target_that_is_not_a_file_is_unchanged(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/null"), Path("")):
        with raises_code(RecordingError, "RID-FILE-WRITE"):
            write_whole(path, b"new")
    assert (tmp_path / "pipe").is_fifo()
    assert Path("/dev/null").is_char_device()


def test_the_old_file_is_unchanged_if_the_new_one_cannot_be_moved(tmp_path: Path) -> None:
    folder = tmp_path / "model.json"
    folder.mkdir()
    (folder / "inside").write_bytes(b"kept")
    with raises_code(RecordingError, "RID-FILE-WRITE"):
        write_whole(folder, b"new")
    assert (folder / "inside").read_bytes() == b"kept"
    assert [item.name for item in tmp_path.iterdir()] == ["model.json"]


@pytest.mark.fault(34)
def test_a_file_that_is_read_back_differently_is_refused_and_rolled_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, measured: Callable[[str], None]
) -> None:
    path = tmp_path / "load.src"
    write_whole(path, b"what was there")
    data = b"LOAD_DATA[1]={M 4.2,CM {X 1.0,Y 2.0,Z 30.0}}"
    bits = random.Random(5).sample(range(8 * len(data)), 200)
    waiting, sync = iter(bits), os.fsync

    def sync_badly(descriptor: int) -> None:
        bit = next(waiting)
        with open(f"/proc/self/fd/{descriptor}", "r+b") as file:
            file.seek(bit // 8)
            file.write(bytes([data[bit // 8] ^ 1 << bit % 8]))
        sync(descriptor)

    monkeypatch.setattr("config.formats.whole_file.os.fsync", sync_badly)
    for _ in bits:
        with raises_code(RecordingError, "RID-FILE-WRITE"):
            write_whole(path, data)
        assert path.read_bytes() == b"what was there"
    assert [item.name for item in tmp_path.iterdir()] == ["load.src"]
    measured(f"{len(bits)} of {len(bits)} changed bits detected, the old file kept")
