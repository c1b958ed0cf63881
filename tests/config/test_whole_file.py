"""A file is written whole, or what was there before stays."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.errors import RecordingError
from config.whole_file import write_whole


def test_a_file_is_replaced_whole_and_nothing_is_left_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    write_whole(path, b"first")
    write_whole(path, b"second")
    assert path.read_bytes() == b"second"
    assert [item.name for item in tmp_path.iterdir()] == ["model.json"]


def test_a_folder_that_is_not_there_is_a_storage_error(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"model\.json: cannot be written"):
        write_whole(tmp_path / "missing" / "model.json", b"{}")


def test_a_planted_link_is_not_followed(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_bytes(b"untouched")
    (tmp_path / "model.json.tmp").symlink_to(victim)
    write_whole(tmp_path / "model.json", b"new")
    assert victim.read_bytes() == b"untouched"
    assert (tmp_path / "model.json").read_bytes() == b"new"


def test_what_was_there_stays_where_the_new_cannot_be_put(tmp_path: Path) -> None:
    folder = tmp_path / "model.json"
    folder.mkdir()
    (folder / "inside").write_bytes(b"kept")
    with pytest.raises(RecordingError, match="cannot be written"):
        write_whole(folder, b"new")
    assert (folder / "inside").read_bytes() == b"kept"
    assert [item.name for item in tmp_path.iterdir()] == ["model.json"]
