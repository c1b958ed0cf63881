"""The process of simulated hardware ignores signals to its process group, and ends with its
program.
"""

from __future__ import annotations

import importlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from config.errors import TransportError
from mock_hw.host.device_process import DeviceProcess, wait_until_ready
from tests.builders.raised_codes import raises_code

pytestmark = pytest.mark.usefixtures("new_python_processes")

ENOUGH_S = 120.0
PROGRAM = """
import multiprocessing, signal, sys
from pathlib import Path
from config.load import load_cell
from drivers.cell import open_cell
from mock_hw.cell import SimulatedCell
from mock_hw.simulation import CellSimulation

loaded, folder = load_cell("ir361"), Path(sys.argv[1])
cell, robot, plant = loaded.config, loaded.robot, loaded.plant
simulation = CellSimulation(cell, robot, plant, realtime=False, seed=1, directory=folder)
with SimulatedCell(simulation) as simulated:
    ending = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    signal.pthread_sigmask(signal.SIG_BLOCK, ending)
    print("served", flush=True)
    signal.sigwait(ending)
    with open_cell(simulated.cell, robot) as opened:
        opened.axes.bring_up()

print("wound up,", len(multiprocessing.active_children()), "left", flush=True)
"""

Start = Callable[[], subprocess.Popen[str]]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Return a function that starts a program with its own process group and simulated hardware."""
    programs: list[subprocess.Popen[str]] = []

    def begin() -> subprocess.Popen[str]:
        program = subprocess.Popen(
            [sys.executable, "-c", PROGRAM, str(tmp_path)],
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        programs.append(program)
        assert program.stdout is not None
        assert program.stdout.readline() == "served\n"
        return program

    yield begin
    for program in programs:
        with program:
            program.kill()


@pytest.mark.slow
def test_signals_to_the_whole_group_do_not_end_the_hardware(start: Start, tmp_path: Path) -> None:
    program = start()
    for number in (signal.SIGHUP, signal.SIGINT, signal.SIGTERM):
        os.killpg(program.pid, number)
    output, _ = program.communicate(timeout=120.0)
    assert output == "wound up, 0 left\n"
    assert program.returncode == 0
    assert [*tmp_path.iterdir()] == []


def test_killing_the_group_finally_ends_the_hardware(start: Start, tmp_path: Path) -> None:
    program = start()
    assert [*tmp_path.iterdir()] != []
    os.killpg(program.pid, signal.SIGKILL)
    assert program.wait(120.0) == -signal.SIGKILL
    tick, deadline_s = threading.Event(), time.monotonic() + ENOUGH_S
    while [*tmp_path.iterdir()] and time.monotonic() < deadline_s:
        tick.wait(0.01)
    assert [*tmp_path.iterdir()] == []


def test_a_process_that_ends_without_a_message_has_not_started() -> None:
    process = DeviceProcess(os._exit)  # os._exit fails, because it accepts no pipe as argument
    try:
        with raises_code(TransportError, "RID-MOCK-ENDED", "start"):
            wait_until_ready("amplifier", process.pipe)
    finally:
        process.end()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP])
def test_a_starting_process_does_not_end_by_signals_to_the_group(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    (tmp_path / f"hardware_{number.name}.py").write_text(
        "import multiprocessing, os\n"
        "if multiprocessing.current_process().name != 'MainProcess':\n"
        f"    os.kill(os.getpid(), {number:d})\n"
        "from mock_hw.host.device_process import leave_signals_to_parent\n"
        "def serve(pipe):\n"
        "    leave_signals_to_parent()\n"
        "    pipe.send(None)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    process = DeviceProcess(importlib.import_module(f"hardware_{number.name}").serve)
    try:
        assert wait_until_ready("hardware", process.pipe) is None
    finally:
        process.end()
