"""Tests of SocketCAN: time stamps, lost frames, bus-off, queues; compared with candump.

These tests run if RID_DAQ_SOCKETCAN names a virtual CAN interface that is up and may be changed: in
the guest that test_guest.py boots, or by hand.
"""

from __future__ import annotations

import os
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from config.cell.cell import CanBusConfig
from config.errors import TransportError
from config.load import LoadedCell, load_cell
from drivers.canopen.frames import Frame
from drivers.cell import Cell, open_cell
from drivers.ports.can_interface import transmit_queue_frames
from drivers.ports.can_link import CanLink, open_can
from drivers.ports.socketcan_port import SocketCanPort
from mock_hw.cell import SimulatedCell
from mock_hw.simulation import CellSimulation
from rid_daq.preflight.bus_check import bus_lines
from tests.builders.raised_codes import raises_code

CHANNEL = os.environ.get("RID_DAQ_SOCKETCAN", "")
pytestmark = pytest.mark.skipif(
    not CHANNEL, reason="test_guest.py runs this in its guest; or set RID_DAQ_SOCKETCAN=can0"
)

IN_THE_GUEST = pytest.mark.skipif(
    "User Mode Linux" not in Path("/proc/cpuinfo").read_text(),
    reason="it sets the computer's date; test_guest.py runs it in its guest",
)

FRAME = struct.Struct("=IB3x8s")
PATIENCE_S = 120.0
MOST_WAITING = 500  # more than the buffer of a plain socket holds


@pytest.fixture
def link() -> Iterator[CanLink]:
    with open_can(CanBusConfig(interface="socketcan", channel=CHANNEL)) as opened:
        yield opened


@pytest.fixture
def raw() -> Iterator[socket.socket]:
    """A plain socket on the same interface."""
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as other:
        other.bind((CHANNEL,))
        other.settimeout(PATIENCE_S)
        yield other


def run(*command: str) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def fast_cell() -> LoadedCell:
    """Return the bundled cell at 125 Hz on the interface, without a plate, with long timeouts."""
    loaded = load_cell("ir361")
    config = loaded.config
    values = {
        "can": CanBusConfig(interface="socketcan", channel=CHANNEL),
        "plate": None,
        "drive_safety": config.drive_safety.model_copy(
            update={"master_heartbeat_timeout_ms": 700, "drive_heartbeat_timeout_ms": 700}
        ),
        "supervision": config.supervision.model_copy(
            update={
                "missed_frames_limit": 30,
                "late_cycles_limit": 30,
                "late_by_cycles_limit": 30.0,
                "late_answers_limit": 100,
                "stuck_encoder_cycles": 30,
                "following_error_min_rad": 0.5,
            }
        ),
    }
    return replace(loaded, config=config.model_copy(update=values))


@pytest.fixture(scope="module")
def loaded() -> LoadedCell:
    return fast_cell()


@pytest.fixture(scope="module")
def simulated(loaded: LoadedCell) -> Iterator[SimulatedCell]:
    assert loaded.plant is not None
    with SimulatedCell(
        CellSimulation(loaded.config, loaded.robot, loaded.plant, realtime=True, seed=4)
    ) as simulated:
        yield simulated


def test_cansend_is_received_and_candump_sees_what_is_sent(link: CanLink) -> None:
    witness = subprocess.Popen(
        ["candump", "-n", "3", "-L", CHANNEL], stdout=subprocess.PIPE, text=True
    )
    received = None
    until_s = time.monotonic() + PATIENCE_S
    # candump needs some time before it listens
    while received is None and time.monotonic() < until_s:
        run("cansend", CHANNEL, "181#3706E803")
        received = link.receive(link.clock.now_s() + 0.5)
        if witness.poll() is None:
            link.send_frames([(0x201, b"\x0f\x00"), (0x202, bytearray(8))])
    assert received == Frame(0x181, bytes.fromhex("3706E803"))
    while witness.poll() is None and time.monotonic() < until_s:
        link.send_frames([(0x201, b"\x0f\x00"), (0x202, bytearray(8))])
    received_data = {line.split()[-1] for line in witness.communicate()[0].splitlines()}
    assert received_data & {"201#0F00", "202#0000000000000000"}
    assert received_data <= {"201#0F00", "202#0000000000000000", "181#3706E803"}


def test_a_frame_read_late_has_its_arrival_time(link: CanLink, raw: socket.socket) -> None:
    before_s = link.clock.now_s()
    raw.send(FRAME.pack(0x181, 2, b"ab"))
    sent_s = link.clock.now_s()
    link.clock.sleep_until(sent_s + 0.2)
    assert link.receive(0.0) == Frame(0x181, b"ab")
    assert before_s - 1e-3 <= link.last_time_s <= sent_s + 0.1


@IN_THE_GUEST
@pytest.mark.parametrize("step_s", [3600.0, -3600.0, 0.4, -0.4])
def test_a_frame_that_waits_while_the_date_is_set_keeps_its_time(
    link: CanLink, raw: socket.socket, step_s: float
) -> None:
    before_s = link.clock.now_s()
    raw.send(FRAME.pack(0x181, 2, b"ab"))
    set_date(step_s)
    raw.send(FRAME.pack(0x182, 2, b"cd"))
    for _ in range(2):
        assert link.receive(0.0) is not None
        assert before_s - 1e-3 <= link.last_time_s <= link.clock.now_s()


def set_date(step_s: float) -> None:
    """Set the date of the guest `step_s` later; the date of the host does not change."""
    time.clock_settime(time.CLOCK_REALTIME, time.clock_gettime(time.CLOCK_REALTIME) + step_s)


def test_only_classic_data_frames_are_returned(link: CanLink, raw: socket.socket) -> None:
    raw.send(FRAME.pack(0x8000_0181, 2, b"ab"))
    raw.send(FRAME.pack(0x4000_0181, 2, b""))
    raw.send(FRAME.pack(0x182, 1, b"c"))
    assert link.receive(link.clock.now_s() + 1.0) == Frame(0x182, b"c")


def test_no_frame_of_a_burst_of_two_thousand_is_lost(raw: socket.socket) -> None:
    with CanLink(SocketCanPort(CHANNEL)) as link:
        for number in range(2000):
            raw.send(FRAME.pack(0x181, 4, number.to_bytes(4, "little")))
        data = []
        while (frame := link.receive(0.0)) is not None:
            data.append(int.from_bytes(frame.data, "little"))
        assert data == list(range(2000))
        assert link.lost_frames == 0


def test_lost_frames_are_counted(raw: socket.socket) -> None:
    port = SocketCanPort(CHANNEL)
    with CanLink(port) as link:
        port._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        for _ in range(200):
            raw.send(FRAME.pack(0x181, 0, b""))
        received = 0
        while link.receive(0.0) is not None:
            received += 1
        raw.send(FRAME.pack(0x181, 0, b""))  # the number of lost frames comes with the next frame
        assert link.receive(1.0 + link.clock.now_s()) is not None
        assert received < 200
        assert link.lost_frames == 200 - received


@pytest.mark.parametrize("can_id", [0x2000_0040, 0x2000_0100], ids=["bus off", "restarted"])
def test_bus_off_is_an_error(link: CanLink, raw: socket.socket, can_id: int) -> None:
    raw.send(FRAME.pack(can_id, 8, bytes(8)))
    with raises_code(TransportError, "RID-CAN-BUS-OFF"):
        link.receive(link.clock.now_s() + 1.0)


def test_error_frames_other_than_bus_off_are_counted(raw: socket.socket) -> None:
    port = SocketCanPort(CHANNEL)
    with CanLink(port) as link:
        raw.send(FRAME.pack(0x2000_0004, 8, b"\0\x10" + bytes(6)))  # error passive
        raw.send(FRAME.pack(0x2000_0004, 8, b"\0\x01" + bytes(6)))  # the controller overran
        raw.send(FRAME.pack(0x181, 0, b""))
        assert link.receive(link.clock.now_s() + 1.0) == Frame(0x181, b"")
        assert (port.error_frames, port.lost_frames) == (2, 1)


@pytest.fixture
def blocked() -> Iterator[None]:
    """Block the output of the interface, as if no node acknowledged frames."""
    run("tc", "qdisc", "add", "dev", CHANNEL, "root", "plug", "limit", "1000000")
    yield
    subprocess.run(["tc", "qdisc", "del", "dev", CHANNEL, "root"], check=False)


def test_few_set_points_are_queued_on_a_dead_bus_and_none_is_sent_later(
    link: CanLink, raw: socket.socket, blocked: None
) -> None:
    queued, text = fill(link)
    assert "transmit queue is full" in text
    assert 18 <= queued <= 32, "the queue must hold one cycle of sixteen axes and few more frames"
    link.close()
    run("ip", "link", "set", CHANNEL, "down")  # as in bus-off: the carrier is lost
    assert "backlog 0b 0p" in run("tc", "-s", "qdisc", "show", "dev", CHANNEL)
    set_points(raw)  # reads the set-points that were sent before
    run("tc", "qdisc", "del", "dev", CHANNEL, "root")
    run("ip", "link", "set", CHANNEL, "up")
    assert set_points(raw) == 0
    sys.stdout.write(
        f"MEASURED full queue: at most {queued} frames wait, 0 are sent when the bus returns\n"
    )


def test_the_preflight_checks_the_transmit_queue(loaded: LoadedCell) -> None:
    before = transmit_queue_frames(CHANNEL)
    try:
        for frames, verdict in ((4, "red"), (10, "ok"), (1000, "red")):
            run("ip", "link", "set", CHANNEL, "txqueuelen", str(frames))
            lines = {line.what: line for line in bus_lines(loaded.config)}
            line = lines.pop("transmit queue (txqueuelen)")
            assert (line.found, line.verdict) == (str(frames), verdict)
            assert {each.verdict for each in lines.values()} <= {"ok", "shown"}
    finally:
        run("ip", "link", "set", CHANNEL, "txqueuelen", str(before))


@IN_THE_GUEST
def test_setting_the_date_does_not_disturb_a_motion(
    simulated: SimulatedCell, loaded: LoadedCell
) -> None:
    with open_cell(simulated.cell, loaded.robot) as cell:
        cell.axes.bring_up()
        cell.axes.start()
        drive(cell, 20)
        for step_s in (3600.0, -3600.0, 0.4, -0.4):
            drive(cell, 5, enable=False, after_sync=partial(set_date, step_s))
        assert simulated.axes().enabled.all()
        assert (cell.axes.answers.late_frames, cell.axes.cyclic.duplicate_frames) == (0, 0)
        assert not cell.axes.take_events()
    sys.stdout.write(
        "MEASURED date set in motion: 20 times, 0 answers missing, late or duplicated\n"
    )


@pytest.mark.parametrize("fault", ["bus-off", "interface down"])
def test_a_bus_lost_during_a_motion_is_an_error_and_nothing_is_sent_later(
    fault: str,
    simulated: SimulatedCell,
    loaded: LoadedCell,
    raw: socket.socket,
) -> None:
    def kill() -> None:
        if fault == "bus-off":
            raw.send(FRAME.pack(0x2000_0040, 8, bytes(8)))
        else:
            run("ip", "link", "set", CHANNEL, "down")

    try:
        with pytest.raises(TransportError):
            die_in_motion(simulated, loaded, kill)
    finally:
        run("ip", "link", "set", CHANNEL, "up")
    until_s = time.monotonic() + PATIENCE_S
    while (axes := simulated.axes()).enabled.any() or np.abs(axes.velocity).max() > 1e-3:
        assert time.monotonic() < until_s, "the drives did not stop by themselves"
        time.sleep(0.05)
    set_points(raw)  # reads the set-points that were sent before
    run("ip", "link", "set", CHANNEL, "down")
    run("ip", "link", "set", CHANNEL, "up")
    assert set_points(raw) == 0
    sys.stdout.write(f"MEASURED {fault}: an error in the same cycle, 0 set-points afterwards\n")


def die_in_motion(simulated: SimulatedCell, loaded: LoadedCell, kill: Callable[[], None]) -> None:
    with open_cell(simulated.cell, loaded.robot) as cell:
        cell.axes.bring_up()
        cell.axes.start()
        drive(cell, 20)
        assert simulated.axes().enabled.all()
        kill()
        drive(cell, 1, enable=False)


def drive(
    cell: Cell,
    cycles: int,
    *,
    enable: bool = True,
    after_sync: Callable[[], None] = lambda: None,
) -> int:
    """Exchange `cycles` cycles over the bus as during a motion, and return their number."""
    next_s = cell.axes.enable() if enable else cell.clock.now_s()
    for _ in range(cycles):
        next_s = max(next_s + cell.config.cycle_time_s, cell.clock.now_s())
        cell.clock.sleep_until(next_s)
        until_s = cell.axes.cyclic.sync() + 1.0
        after_sync()
        cell.axes.cyclic.collect(until_s)
        assert cell.axes.answers.received.all()
        assert cell.axes.command(np.full(3, 0.1))
        cell.axes.send_heartbeat(cell.clock.now_s())
    return cycles


def set_points(raw: socket.socket, listen_s: float = 0.5) -> int:
    """Return the number of set-points that were waiting or arrive within `listen_s`."""
    until_s = time.monotonic() + listen_s
    raw.settimeout(0.05)
    count = waiting = 0
    while time.monotonic() < until_s or 0 < waiting < MOST_WAITING:
        try:
            count += 0x201 <= FRAME.unpack(raw.recv(16))[0] <= 0x203
            waiting += time.monotonic() >= until_s
        except TimeoutError:
            waiting = 0
        except OSError:  # the socket reports once that the interface was down
            continue
    return count


def fill(link: CanLink) -> tuple[int, str]:
    """Return the number of set-points queued until the bus refused one, and the error text."""
    for queued in range(1000):
        try:
            link.send(Frame(0x201, queued.to_bytes(8, "little")))
        except TransportError as error:
            return queued, str(error)
    return 1000, ""


def test_the_kernels_slcan_driver_works_with_the_simulated_adapter(loaded: LoadedCell) -> None:
    assert loaded.plant is not None
    config = loaded.config.model_copy(
        update={"can": CanBusConfig(interface="slcan", channel="adapter"), "cycle_time_ms": 20}
    )
    with SimulatedCell(
        CellSimulation(config, loaded.robot, loaded.plant, realtime=True, seed=4)
    ) as simulated:
        driver = subprocess.Popen(
            ["slcand", "-F", "-o", "-s8", os.path.realpath(simulated.channel), "slcan0"]
        )
        try:
            until_s = time.monotonic() + PATIENCE_S
            while not os.path.exists("/sys/class/net/slcan0"):
                assert time.monotonic() < until_s
                time.sleep(0.05)
            run("ip", "link", "set", "slcan0", "up")
            can = CanBusConfig(interface="socketcan", channel="slcan0")
            with open_cell(config.model_copy(update={"can": can}), loaded.robot) as cell:
                cell.axes.bring_up()
                cell.axes.start()
                drive(cell, 20)
                assert simulated.axes().enabled.all()
            assert not simulated.axes().enabled.any()
        finally:
            driver.terminate()
            driver.wait(PATIENCE_S)
