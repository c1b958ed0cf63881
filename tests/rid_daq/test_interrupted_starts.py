"""Ctrl-C while a process starts: the starting program leaves no process behind."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any, cast

import pytest

from acquisition.runs.folder import RunFolder
from acquisition.session.frame_recorder import FrameRecorder
from compensation.online.point_ring import PointRing
from compensation.online.point_server import PointServer, PointService
from config.cell.cell import CanBusConfig
from config.load import load_cell
from mock_hw.host.device_process import DeviceProcess, leave_signals_to_parent
from rid_daq.demo.parallel import run_stories
from rid_daq.preflight.computer_check import time_lines
from rid_daq.terminal.console import Console

pytestmark = pytest.mark.slow


def wait_as_device(pipe: Any) -> None:
    """Wait for a message, as the process of a simulated device does."""
    leave_signals_to_parent()
    pipe.recv()


def serve_points(folder: Path) -> None:
    loaded = load_cell("ir361")
    service = PointService(loaded.config, loaded.robot, 10)
    with PointServer(folder / "points", PointRing.create(3, 20), service):
        raise AssertionError("SIGINT was not received")


def record_frames(folder: Path) -> None:
    FrameRecorder(CanBusConfig(interface="rid_sim", channel="nobody"), folder / "frames.blf")


def start_stories(folder: Path) -> None:
    run_stories(RunFolder.create(folder, "demo"), cast(Any, None), 1.0, 1, Console())


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[int]]:
    """Raise SIGINT after the start of each process; yield the list of their process ids.

    The kernel can deliver a signal to any thread. Here a thread receives it that starts no process.
    """
    pids: list[int] = []
    start = SpawnProcess.start
    with ThreadPoolExecutor(1) as other:
        other.submit(int).result()  # the thread runs and can receive signals

        def interrupted(process: SpawnProcess) -> None:
            start(process)
            assert process.pid is not None
            pids.append(process.pid)
            other.submit(signal.raise_signal, signal.SIGINT).result()

        monkeypatch.setattr(SpawnProcess, "start", interrupted)
        yield pids


@pytest.mark.usefixtures("new_python_processes")
@pytest.mark.parametrize(
    "owner",
    [
        lambda _folder: DeviceProcess(wait_as_device),
        record_frames,
        serve_points,
        lambda _folder: time_lines(),
        start_stories,
    ],
    ids=["device", "frames", "points", "check", "demo"],
)
def test_ctrl_c_during_a_start_leaves_no_process(
    owner: Callable[[Path], object], started: list[int], tmp_path: Path
) -> None:
    with pytest.raises(KeyboardInterrupt):
        owner(tmp_path)
    assert len(started) == 1
    assert not Path(f"/proc/{started[0]}").exists()
    assert not (tmp_path / "points").exists()
