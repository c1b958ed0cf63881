"""One acceptance suite for simulated drives on every bus: bring-up, preflight, recording, stops.

The tests run alone and in real time; failures during a stall of the computer do not count
(tests/builders/stalls.py). Tests that a bus cannot support are omitted: `virtual` works within one
process, so it can serve neither a session of several processes nor a process that dies. SocketCAN
is tested if RID_DAQ_SOCKETCAN names an interface that is up; tests/socketcan provides a kernel with
such an interface.
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import can
import numpy as np
import pytest

from acquisition.journal.cycles import read_journal
from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.motion.samples import MotionSamples
from acquisition.runs.folder import RunFolder
from acquisition.session.record import record_motion
from acquisition.supervision.stop_reason import StopCode
from config.cell.cell import CanBusConfig, CellConfig
from config.errors import ConfigError, LockedError
from config.load import LoadedCell, load_cell
from drivers.cell import Cell, open_cell
from mock_hw.cell import SimulatedCell
from mock_hw.simulation import CellSimulation
from rid_daq.preflight.preflight import lines_before_bus, preflight
from tests.builders.raised_codes import raises_code
from tests.builders.stalls import where_time_runs

pytestmark = pytest.mark.alone

PATIENCE_S = 120.0
STALL_S = 0.01
SPEED_RAD_S = 0.3
SOCKETCAN = os.environ.get("RID_DAQ_SOCKETCAN", "")

CHANNELS = {
    "rid_sim": "accept",
    "udp_multicast": f"239.74.163.7@{20_000 + os.getpid() % 20_000}",
    "slcan": "accept",
    "socketcan": SOCKETCAN,
    "virtual": "accept",
}
SESSIONS = ["socketcan"] if SOCKETCAN else ["rid_sim", "udp_multicast", "slcan"]
SHARED = [name for name in SESSIONS if name != "slcan"]  # only one program can open a port
RECORDED = [name for name in SESSIONS if name != "rid_sim"]  # tests/acquisition records on this bus

MOVE_FOR_EVER = f"""
import sys
from pathlib import Path
import numpy as np
from config.cell.cell import CellConfig
from config.load import load_cell
from drivers.cell import open_cell

config = CellConfig.model_validate_json(sys.argv[1])
with open_cell(config, load_cell("ir361").robot) as cell:
    cell.axes.bring_up()
    cell.axes.start()
    next_s = cell.axes.enable()
    for cycle in range(10**9):
        next_s = max(next_s + config.cycle_time_s, cell.clock.now_s())
        cell.clock.sleep_until(next_s)
        now_s = cell.axes.exchange()
        cell.axes.send_heartbeat(now_s)
        assert cell.axes.command(np.full(3, {SPEED_RAD_S} * np.sin(cycle * 0.02)))
        if cycle == 40:
            print("moving", flush=True)
"""


def patient_cell(interface: str, channel: str) -> LoadedCell:
    """Return the bundled cell without a plate on a bus, with limits for a busy test computer."""
    loaded = load_cell("ir361")
    safety = loaded.config.drive_safety.model_copy(
        update={
            "master_heartbeat_ms": 40,
            "master_heartbeat_timeout_ms": 700,
            "drive_heartbeat_ms": 100,
            "drive_heartbeat_timeout_ms": 700,
            "following_error_timeout_ms": 200,
        }
    )
    supervision = loaded.config.supervision.model_copy(
        update={
            "missed_frames_limit": 35,
            "late_cycles_limit": 50,
            "late_by_cycles_limit": 35.0,
            "late_answers_limit": 100,
            "stuck_encoder_cycles": 35,
            "following_error_per_velocity_s": 0.3,
            "following_error_min_rad": 0.5,
        }
    )
    values: dict[str, object] = {
        "can": CanBusConfig(interface=interface, channel=channel),
        "cycle_time_ms": 20,
        "plate": None,
        "drive_safety": safety,
        "supervision": supervision,
    }
    return replace(loaded, config=loaded.config.model_copy(update=values))


@dataclass
class Served:
    """Simulated drives on a bus, and the cell file for them."""

    loaded: LoadedCell
    simulated: SimulatedCell
    folder: Path

    @property
    def cell(self) -> CellConfig:
        return self.simulated.cell

    def open(self, **safety: object) -> Cell:
        changed = self.cell.drive_safety.model_copy(update=safety)
        cell = self.cell.model_copy(update={"drive_safety": changed})
        return open_cell(cell, self.loaded.robot)

    def await_rest(self) -> None:
        """Wait until the simulated axes are at rest without power."""
        until_s = time.monotonic() + PATIENCE_S
        while (axes := self.simulated.axes()).enabled.any() or np.abs(axes.velocity).max() > 1e-3:
            assert time.monotonic() < until_s, "the axes were not stopped"
            time.sleep(0.05)


Scenario = Callable[[Served], None]


@contextlib.contextmanager
def serve(interface: str, folder: Path) -> Iterator[Served]:
    loaded = patient_cell(interface, CHANNELS[interface])
    assert loaded.plant is not None
    with SimulatedCell(
        CellSimulation(loaded.config, loaded.robot, loaded.plant, realtime=True, seed=2)
    ) as simulated:
        yield Served(loaded, simulated, folder)


def on(*interfaces: str) -> Callable[[Scenario], Callable[..., None]]:
    """Return a decorator that runs a test once per bus, each time with new simulated drives."""

    def decorate(scenario: Scenario) -> Callable[..., None]:
        @pytest.mark.parametrize("interface", interfaces)
        def test(interface: str, tmp_path_factory: pytest.TempPathFactory) -> None:
            def attempt() -> None:
                with serve(interface, tmp_path_factory.mktemp("acceptance")) as served:
                    scenario(served)

            where_time_runs(attempt, STALL_S)

        return test

    return decorate


def motion(loaded: LoadedCell) -> MotionSamples:
    joints = tuple(
        FourierJoint(joint=name, offset=0.1, sine=(0.1,), cosine=(0.0,))
        for name in loaded.robot.joint_names
    )
    return FourierMotion(
        kind="fourier", robot="ir361", period_s=1.0, periods=2, ramp_s=0.5, joints=joints
    ).plan(
        loaded.robot,
        loaded.config.cycle_time_s,
    )


def move(served: Served, cell: Cell, cycles: int) -> None:
    next_s = cell.axes.enable()
    for cycle in range(cycles):
        next_s = max(next_s + served.cell.cycle_time_s, cell.clock.now_s())
        cell.clock.sleep_until(next_s)
        now_s = cell.axes.cyclic.sync()
        cell.axes.cyclic.collect(now_s + 1.0)
        cell.axes.send_heartbeat(now_s)
        assert cell.axes.answers.received.all()
        assert cell.axes.command(np.full(3, SPEED_RAD_S * np.sin(0.1 * cycle)))


def assert_moves(served: Served) -> None:
    """Bring up, move, and compare with the truth; at the end power must be off."""
    with served.open() as cell:
        cell.axes.bring_up()
        assert {setting.verdict for setting in cell.axes.settings()} <= {"ok", "shown"}
        cell.axes.start()
        move(served, cell, 30)
        truth = served.simulated.axes()
        assert truth.enabled.all()
        assert cell.axes.answers.position == pytest.approx(truth.position, abs=0.1)
        assert cell.axes.halt()
        assert cell.axes.take_events() == ()
    assert not served.simulated.axes().enabled.any()


@on(*SESSIONS)
def test_drives_are_brought_up_moved_and_disabled(served: Served) -> None:
    assert_moves(served)
    assert_moves(served)  # a second master can follow the first one


@on(*SESSIONS)
def test_the_preflight_passes_and_moves_nothing(served: Served) -> None:
    lines, problem = preflight(
        served.loaded,
        served.cell,
        lines_before_bus(served.loaded, served.folder),
        1.0,
        cleared=True,
    )
    assert problem is None
    assert [line for line in lines if line.verdict == "red"] == []
    assert not served.simulated.axes().enabled.any()


@on(*RECORDED)
def test_a_short_motion_is_recorded_completely(served: Served) -> None:
    folder = RunFolder.create(served.folder / "runs", "accept")
    samples = motion(served.loaded)
    outcome = record_motion(served.cell, served.loaded.robot, samples, folder)
    assert outcome.complete, outcome.stop
    journal = read_journal(outcome.path)
    assert outcome.rows == len(journal.rows)
    assert not served.simulated.axes().enabled.any()


@on(*RECORDED)
def test_a_drives_fault_stops_the_motion(served: Served) -> None:
    folder = RunFolder.create(served.folder / "runs", "fault")
    narrow = served.cell.drive_safety.model_copy(
        update={"following_error_rad": 2e-3, "following_error_timeout_ms": 0}
    )
    cell = served.cell.model_copy(update={"drive_safety": narrow})
    outcome = record_motion(cell, served.loaded.robot, motion(served.loaded), folder)
    assert outcome.stop is not None
    assert outcome.stop.code is StopCode.EMERGENCY
    assert "following error" in outcome.stop.text
    served.await_rest()
    with served.open() as opened:  # the drives must be reset before the next motion
        assert any(drive.was_faulty for drive in opened.axes.service.reset_faults())


@on(*SESSIONS)
def test_the_axes_of_a_killed_host_come_to_rest_by_themselves(served: Served) -> None:
    host = subprocess.Popen(
        [sys.executable, "-c", MOVE_FOR_EVER, served.cell.model_dump_json()], stdout=subprocess.PIPE
    )
    try:
        assert host.stdout is not None
        assert host.stdout.readline() == b"moving\n"
        assert served.simulated.axes().enabled.all()
    finally:
        host.send_signal(signal.SIGKILL)
        host.communicate()
    served.await_rest()
    assert_moves(served)  # after the reset, bring-up works again


@on(*SHARED)
def test_another_master_is_detected_before_anything_is_sent(served: Served) -> None:
    with other_master(served.cell.can) as bus, served.open() as cell:
        bus.send(can.Message(arbitration_id=0x80, is_extended_id=False))
        with raises_code(LockedError, "RID-CAN-FOREIGN-MASTER", "SYNC"):
            cell.axes.bring_up()


def other_master(bus: CanBusConfig) -> can.BusABC:
    if bus.interface == "udp_multicast":
        group, _, port = bus.channel.partition("@")
        return can.Bus(interface="udp_multicast", channel=group, port=int(port), hop_limit=0)
    return can.Bus(interface=bus.interface, channel=bus.channel)


@on("virtual")
def test_the_virtual_bus_works_within_one_process(served: Served) -> None:
    assert_moves(served)


def test_simulated_time_needs_the_bus_rid_sim() -> None:
    loaded = patient_cell("slcan", "accept")
    assert loaded.plant is not None
    simulated = SimulatedCell(
        CellSimulation(loaded.config, loaded.robot, loaded.plant, realtime=False, seed=2)
    )
    with raises_code(ConfigError, "RID-MOCK-REAL-TIME", "slcan"):
        simulated.__enter__()
