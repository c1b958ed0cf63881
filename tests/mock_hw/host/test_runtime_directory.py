"""Sockets are in folders that only this user can write to.

Files and folders of killed programs are removed.
"""

from __future__ import annotations

import contextlib
import multiprocessing.connection
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from config.errors import TransportError
from mock_hw.host.runtime_directory import (
    folder_in_use,
    private_folder,
    runtime_directory,
    socket_path,
)
from rid_daq.session.running_sessions import running_sessions
from tests.builders.raised_codes import raises_code

PROGRAM = """
import multiprocessing, signal
from config.load import load_cell
from mock_hw.cell import SimulatedCell
from mock_hw.simulation import CellSimulation
from rid_daq.session.session import hold_cell

if __name__ == "__main__":
    loaded = load_cell("ir361")
    with SimulatedCell(CellSimulation(
        loaded.config, loaded.robot, loaded.plant, realtime=False, seed=1
    )) as simulated, hold_cell(simulated.cell):
        print(*(child.pid for child in multiprocessing.active_children()), flush=True)
        signal.pause()
"""


@pytest.fixture
def base(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path


def test_the_folder_is_created_without_access_for_others(base: Path) -> None:
    directory = runtime_directory()
    assert directory == base / "rid-daq"
    assert directory.stat().st_mode & 0o777 == 0o700


def test_a_runtime_folder_accessible_to_others_is_refused(base: Path) -> None:
    (base / "rid-daq").mkdir()
    (base / "rid-daq").chmod(0o755)
    with raises_code(TransportError, "RID-RUNTIME-NOT-PRIVATE", "700"):
        runtime_directory()


def test_a_link_instead_of_the_folder_is_refused(base: Path) -> None:
    (base / "elsewhere").mkdir()
    (base / "rid-daq").symlink_to(base / "elsewhere")
    with raises_code(TransportError, "RID-RUNTIME-NOT-PRIVATE"):
        runtime_directory()


def test_names_are_resolved_in_the_folder_and_paths_are_unchanged(base: Path) -> None:
    assert socket_path("ir361") == base / "rid-daq" / "ir361.sock"
    assert socket_path("/run/x/y.sock") == Path("/run/x/y.sock")


def test_a_path_too_long_for_a_socket_is_refused() -> None:
    with raises_code(TransportError, "RID-SOCKET-PATH", "107"):
        socket_path("/" + "x" * 200 + "/a.sock")


@pytest.mark.fault(50)
def test_files_of_a_killed_cell_are_removed_at_the_next_start(
    base: Path, tmp_path: Path, measured: Callable[[str], None]
) -> None:
    script = tmp_path / "program.py"
    script.write_text(PROGRAM)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(
        [sys.executable, str(script)], stdout=subprocess.PIPE, text=True, env=environment
    ) as program:
        assert program.stdout is not None
        hardware = [int(word) for word in program.stdout.readline().split()]
        (left,) = runtime_directory().iterdir()
        with private_folder("next"):
            assert (left / "ir361.sock").is_socket(), "a hub serves the socket"
        with contextlib.ExitStack() as ends:
            processes = [os.pidfd_open(pid) for pid in hardware]
            for process in processes:
                ends.callback(os.close, process)
                signal.pidfd_send_signal(process, signal.SIGSTOP)
            program.kill()
            program.wait(120.0)
            with private_folder("next"):
                assert (left / "ir361.sock").is_socket(), "hub and drives survive the program"
            for process in processes:
                signal.pidfd_send_signal(process, signal.SIGKILL)
            for process in processes:
                multiprocessing.connection.wait([process], 60.0)
        assert left.is_dir()
        assert running_sessions() == []
    with private_folder("next") as folder:
        assert [*runtime_directory().iterdir()] == [folder]
    assert [*runtime_directory().iterdir()] == []
    measured(f"1 program and {len(hardware)} processes killed: 0 old folders after the next start")


def test_a_folder_is_kept_as_long_as_it_is_used(base: Path) -> None:
    with contextlib.ExitStack() as first:
        folder = first.enter_context(private_folder("first"))
        with private_folder("second") as second, folder_in_use(folder):
            assert {folder, second} == {*runtime_directory().iterdir()}
    assert [*runtime_directory().iterdir()] == []


def test_a_folder_of_a_killed_program_is_removed_and_foreign_files_are_kept(base: Path) -> None:
    (runtime_directory() / "cell-x").mkdir()
    (runtime_directory() / "notes").mkdir()
    (runtime_directory() / "notes" / "kept").touch()
    (runtime_directory() / "ir361.sock").touch()
    with private_folder("next") as folder:
        left = {path.name for path in runtime_directory().iterdir()}
    assert left == {folder.name, "notes", "ir361.sock"}
