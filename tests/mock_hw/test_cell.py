"""Simulated cell as processes: its output is repeatable to the byte, axes stop if masters die, and
no process is left over.
"""

from __future__ import annotations

import contextlib
import math
import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from config.errors import TransportError
from config.load import LoadedCell, load_cell
from drivers.canopen.emcy import parse_emcy
from drivers.cell import Cell, open_cell
from mock_hw.bus.arbitration import WireFrame
from mock_hw.bus.hub_client import HubClient
from mock_hw.bus.hub_protocol import HubRole
from mock_hw.cell import SimulatedCell
from mock_hw.plant.snapshot import AxisSnapshot, SnapshotReader
from mock_hw.rack_loop import LONGEST_WAIT_S
from mock_hw.simulation import CellSimulation
from tests.builders.raised_codes import raises_code

pytestmark = pytest.mark.slow

SPEED_RAD_S = 0.3
MOVE_FOR_EVER = f"""
import os, sys
import numpy as np
from config.load import load_cell
from drivers.cell import Cell, open_cell

loaded = load_cell("ir361")
config = loaded.config.model_copy(
    update={{"can": loaded.config.can.model_copy(update={{"channel": sys.argv[1]}})}}
)

def move():
    with open_cell(config, loaded.robot) as cell:
        cell.axes.bring_up()
        cell.axes.start()
        next_s = cell.axes.enable()
        for cycle in range(10**9):
            next_s += config.cycle_time_s
            cell.clock.sleep_until(next_s)
            now_s = cell.axes.exchange()
            assert cell.axes.command(np.full(3, {SPEED_RAD_S} * np.sin(cycle * 0.02)))
            cell.axes.send_heartbeat(now_s)
            if cycle == 100:
                print("moving", flush=True)
            if cycle > 100 and abs(np.sin(cycle * 0.02)) > 0.99 and "once" in sys.argv:
                os.kill(os.getpid(), 9)
"""


@pytest.fixture(scope="module")
def loaded() -> LoadedCell:
    return load_cell("ir361")


@pytest.fixture
def short_path() -> Iterator[Path]:
    """A folder whose path is short enough for a socket."""
    path = Path("/tmp") / f"rid-daq-test-{os.getpid()}"
    path.mkdir(mode=0o700)
    yield path
    shutil.rmtree(path, ignore_errors=True)


def simulate(
    loaded: LoadedCell,
    *,
    realtime: bool = False,
    log: Path | None = None,
    directory: Path | None = None,
) -> SimulatedCell:
    assert loaded.plant is not None
    return SimulatedCell(
        CellSimulation(
            loaded.config,
            loaded.robot,
            loaded.plant,
            realtime=realtime,
            seed=5,
            log=log,
            directory=directory,
        )
    )


def run_a_little(simulated: SimulatedCell, loaded: LoadedCell) -> AxisSnapshot:
    """Bring up, enable, move for a second, and leave."""
    with open_cell(simulated.cell, loaded.robot) as cell:
        cell.axes.bring_up()
        cell.axes.start()
        next_s = cell.axes.enable()
        for cycle in range(125):
            next_s += simulated.cell.cycle_time_s
            cell.clock.sleep_until(next_s)
            now_s = cell.axes.exchange()
            assert cell.axes.answers.received.all()
            assert cell.axes.command(np.full(3, SPEED_RAD_S * math.sin(0.05 * cycle)))
            cell.axes.send_heartbeat(now_s)
        assert cell.axes.take_events() == ()
        truth = simulated.axes()
        assert truth.enabled.all()
        assert abs(truth.time_s - cell.clock.now_s()) < 0.010
        assert cell.axes.answers.position == pytest.approx(truth.position, abs=1e-2)
        assert np.abs(truth.velocity).max() > 0.05
    return simulated.axes()


def test_a_lock_step_run_is_repeatable_to_the_byte(loaded: LoadedCell, tmp_path: Path) -> None:
    logs = [tmp_path / "one.log", tmp_path / "two.log"]
    others = multiprocessing.active_children()
    for log in logs:
        with simulate(loaded, log=log) as simulated:
            folder = Path(simulated.channel).parent
            assert folder.stat().st_mode & 0o077 == 0
            end = run_a_little(simulated, loaded)
            assert not end.enabled.any()
            with open_cell(simulated.cell, loaded.robot) as cell:
                cell.axes.bring_up()
        assert not folder.exists()
        assert set(multiprocessing.active_children()) <= set(others)
    one, two = sorted((log.read_bytes() for log in logs), key=len)
    assert len(one.splitlines()) > 1000
    assert two.startswith(one), "the logs must differ only at the end, without a master"
    assert len(two) - len(one) < 1000


def test_the_trimmed_exchange_moves_the_robot_and_stops_it(loaded: LoadedCell) -> None:
    config = loaded.config.model_copy(update={"exchange": "trimmed"})
    with simulate(replace(loaded, config=config)) as simulated:
        end = run_a_little(simulated, loaded)
        assert not end.enabled.any()
        with open_cell(simulated.cell, loaded.robot) as cell:
            cell.axes.bring_up()
            found = {s.object_name: s.found for s in cell.axes.settings() if s.node_id == 2}
            assert (found["1600h:00"], found["1A00h:00"], found["1801h:05"]) == ("1h", "2h", "64h")
            cell.axes.start()
            cell.axes.enable()
            simulated_drive_faults(simulated, cell)
            assert not cell.axes.command(np.zeros(3))
        assert stopped(simulated.axes())


def simulated_drive_faults(simulated: SimulatedCell, cell: Cell) -> None:
    """Make axis 2 leave Operation Enabled by a controlword from another sender."""
    with sending_listener(simulated) as stranger:
        for _ in range(4):
            stranger.send(0x302, b"\x00\x00", 2)
            cell.clock.sleep_until(cell.clock.now_s() + cell.config.cycle_time_s)
            cell.axes.exchange()
            cell.axes.send_heartbeat(cell.clock.now_s())
    assert any(event.kind.is_fault for event in cell.axes.take_events())


@contextlib.contextmanager
def sending_listener(simulated: SimulatedCell) -> Iterator[HubClient]:
    """Return a client of the bus that observes it and can also send."""
    client = HubClient(Path(simulated.channel), HubRole.OBSERVER)
    try:
        yield client
    finally:
        client.close()


def stopped(axes: AxisSnapshot) -> bool:
    return not axes.enabled.any() and bool(np.abs(axes.velocity).max() < 1e-3)


def watch(observer: HubClient, seconds: float) -> list[WireFrame]:
    """Return the frames that arrive within some seconds of real time."""
    frames: list[WireFrame] = []
    until_ns = time.monotonic_ns() + round(seconds * 1e9)
    while time.monotonic_ns() < until_ns:
        frames += observer.wait(until_ns)
    return frames


def test_the_axes_of_a_killed_master_are_at_rest_in_time(loaded: LoadedCell) -> None:
    with simulate(loaded) as simulated:
        observer = HubClient(Path(simulated.channel), HubRole.OBSERVER)
        before = simulated.axes().position
        command = [sys.executable, "-c", MOVE_FOR_EVER + "move()", simulated.channel, "once"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as master:
            assert master.stdout is not None
            assert master.stdout.readline() == "moving\n"
            assert master.wait(120.0) == -signal.SIGKILL
        deadline_s = time.monotonic() + 120.0
        frames = []
        moved_at_s, at_rest = 0.0, simulated.axes()
        while not stopped(at_rest) and time.monotonic() < deadline_s:
            moved_at_s = at_rest.time_s
            frames += watch(observer, 0.002)
            at_rest = simulated.axes()
        frames += watch(observer, 0.5)
        observer.close()
    assert np.abs(at_rest.position - before).min() > 0.05, "the axes must have moved before"
    last_sync_s = max(f.time_ns for f in frames if f.can_id == 0x080) * 1e-9
    cut = [f for f in frames if 0x081 <= f.can_id <= 0x083]
    codes = [parse_emcy(f.data).code for f in cut]
    assert codes.count(0x8130) == 3, "each drive misses the heartbeat"
    assert set(codes) <= {0x8130, 0x8250}, "the set-points may be missing first"
    assert all(f.time_ns * 1e-9 < last_sync_s + 0.100 for f in cut)
    ramp_s = SPEED_RAD_S / loaded.config.drive_safety.quick_stop_deceleration_rad_s2
    assert stopped(at_rest)
    assert moved_at_s < last_sync_s + 0.100 + ramp_s + LONGEST_WAIT_S


def test_the_drives_survive_their_killed_program_until_they_have_stopped(
    short_path: Path,
) -> None:
    program = (
        MOVE_FOR_EVER
        + """
from pathlib import Path
from mock_hw.cell import SimulatedCell
from mock_hw.simulation import CellSimulation
if __name__ == "__main__":
    with SimulatedCell(CellSimulation(
        loaded.config,
        loaded.robot,
        loaded.plant,
        realtime=False,
        seed=0,
        directory=Path(sys.argv[2]),
    )) as simulated:
        move()
"""
    )
    script = short_path / "program.py"
    script.write_text(program)
    channel = short_path / "ir361.sock"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(
        [sys.executable, str(script), str(channel), str(short_path), "once"],
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
    ) as master:
        assert master.stdout is not None
        assert master.stdout.readline() == "moving\n"
        observer = HubClient(channel, HubRole.OBSERVER)
        reader = SnapshotReader(short_path / "ir361.axes")
        master.wait(120.0)
    with raises_code(TransportError, "RID-MOCK-ENDED", "ir361.sock: "):
        watch(observer, 30.0)
    observer.close()
    with reader:
        end = reader.read()
    assert stopped(end)
    tick, deadline_s = threading.Event(), time.monotonic() + 120.0
    while len([*short_path.iterdir()]) > 1 and time.monotonic() < deadline_s:
        tick.wait(0.01)
    assert [path.name for path in short_path.iterdir()] == ["program.py"]


def test_a_cell_that_is_already_served_is_refused(loaded: LoadedCell, short_path: Path) -> None:
    with simulate(loaded, directory=short_path):
        with (
            raises_code(TransportError, "RID-MOCK-ENDED", "ir361.sock: another"),
            simulate(loaded, directory=short_path),
        ):
            pass
        assert (short_path / "ir361.sock").is_socket()
    assert [*short_path.iterdir()] == []


def test_a_cell_that_is_not_running_has_no_axes(loaded: LoadedCell) -> None:
    with raises_code(TransportError, "RID-API-ARGUMENT"):
        simulate(loaded).axes()
