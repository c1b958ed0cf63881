"""Signals to all processes of a program do not end its simulated hardware; its end does."""

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
    """Start a program that leads a process group, and return once its hardware is served."""
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
def test_signals_to_the_whole_group_leave_the_hardware_to_the_program(
    start: Start, tmp_path: Path
) -> None:
    program = start()
    for number in (signal.SIGHUP, signal.SIGINT, signal.SIGTERM):
        os.killpg(program.pid, number)
    said, _ = program.communicate(timeout=120.0)
    assert said == "wound up, 0 left\n"
    assert program.returncode == 0
    assert [*tmp_path.iterdir()] == []


def test_a_killed_group_takes_the_hardware_with_it_in_the_end(start: Start, tmp_path: Path) -> None:
    program = start()
    assert [*tmp_path.iterdir()] != []
    os.killpg(program.pid, signal.SIGKILL)
    assert program.wait(120.0) == -signal.SIGKILL
    tick, deadline_s = threading.Event(), time.monotonic() + ENOUGH_S
    while [*tmp_path.iterdir()] and time.monotonic() < deadline_s:
        tick.wait(0.01)
    assert [*tmp_path.iterdir()] == []


def test_a_process_that_ends_without_a_word_did_not_start() -> None:
    process = DeviceProcess(os._exit)  # which takes no pipe for an argument
    try:
        with raises_code(TransportError, "RID-MOCK-ENDED", "start"):
            wait_until_ready("amplifier", process.pipe)
    finally:
        process.end()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP])
def test_a_process_that_is_still_starting_leaves_signals_to_the_program_too(
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
