"""Sockets live where only this user can put them."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.errors import TransportError
from mock_hw.runtime_directory import runtime_directory, socket_path


@pytest.fixture
def base(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path


def test_the_folder_is_made_and_closed_to_others(base: Path) -> None:
    directory = runtime_directory()
    assert directory == base / "rid-daq"
    assert directory.stat().st_mode & 0o777 == 0o700


def test_a_folder_that_is_open_to_others_is_refused(base: Path) -> None:
    (base / "rid-daq").mkdir()
    (base / "rid-daq").chmod(0o755)
    with pytest.raises(TransportError, match="chmod 700"):
        runtime_directory()


def test_a_link_to_somewhere_else_is_refused(base: Path) -> None:
    (base / "elsewhere").mkdir()
    (base / "rid-daq").symlink_to(base / "elsewhere")
    with pytest.raises(TransportError, match="not a folder"):
        runtime_directory()


def test_names_resolve_in_the_folder_and_paths_stay_paths(base: Path) -> None:
    assert socket_path("ir361") == base / "rid-daq" / "ir361.sock"
    assert socket_path("/run/x/y.sock") == Path("/run/x/y.sock")


def test_a_path_too_long_for_a_socket_is_named() -> None:
    with pytest.raises(TransportError, match="107 bytes"):
        socket_path("/" + "x" * 200 + "/a.sock")
