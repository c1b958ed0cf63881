"""Simulated bus as a python-can interface: in real time, and in lock-step on simulated time."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import can
import pytest

from config.cell.cell import CanBusConfig
from config.simulation.faults import AdapterFault, FaultScript
from drivers.canopen.frames import SYNC, Frame
from drivers.ports.can_link import open_can
from mock_hw.bus.arbitration import WireFrame
from mock_hw.bus.can_plugin import RidSimBus
from mock_hw.bus.faults import BusFaults
from mock_hw.bus.hub_client import HubClient
from mock_hw.bus.hub_process import listening_socket
from mock_hw.bus.hub_protocol import FRAME, PacketKind, pack
from mock_hw.bus.wire_time import wire_bits

Serve = Callable[..., Any]
Join = Callable[..., RidSimBus]


@pytest.fixture
def join() -> Iterator[Join]:
    """Return a function that opens buses through python-can, as users do."""
    buses: list[can.BusABC] = []

    def start(hub: Any, **options: Any) -> RidSimBus:
        bus = can.Bus(interface="rid_sim", channel=str(hub.path), ignore_config=True, **options)
        assert isinstance(bus, RidSimBus)
        buses.append(bus)
        return bus

    yield start
    for bus in buses:
        bus.shutdown()


def message(can_id: int, data: bytes = b"") -> can.Message:
    return can.Message(arbitration_id=can_id, data=data, is_extended_id=False)


def test_timeouts_and_sleeps_are_exact_on_the_simulated_clock(serve: Serve, join: Join) -> None:
    bus = join(serve(), participant=True)
    clock = bus.simulated_clock
    assert clock is not None
    assert clock.now_s() == 0.0
    assert bus.recv(1.5) is None
    assert clock.now_s() == 1.5
    clock.sleep_until(3600.0)
    assert clock.now_s() == 3600.0
    clock.sleep_until(float("-inf"))
    assert clock.now_s() == 3600.0


def test_frames_have_their_time_on_the_wire(serve: Serve, join: Join) -> None:
    hub = serve()
    observer = join(hub)
    bus = join(hub, participant=True)
    bus.send(message(0x181, b"\x01\x02"))
    assert bus.recv(0.01) is None, "a sender does not receive its own frame"
    received = observer.recv(5.0)
    assert received is not None
    assert (received.arbitration_id, bytes(received.data), received.is_extended_id) == (
        0x181,
        b"\1\2",
        False,
    )
    assert received.timestamp == pytest.approx((wire_bits(0x181, b"\1\2") - 3) * 1e-6)


def test_all_kinds_of_classic_frames_are_transmitted(serve: Serve, join: Join) -> None:
    hub = serve(realtime=True)
    one, other = join(hub), join(hub)
    sent = [
        message(0x7FF, bytes(8)),
        can.Message(arbitration_id=0x1ABCDEF0, data=b"abc", is_extended_id=True),
        can.Message(arbitration_id=0x701, is_remote_frame=True, dlc=1, is_extended_id=False),
    ]
    for frame in sent:
        one.send(frame)
        got = other.recv(5.0)
        assert got is not None
        assert got.equals(frame, timestamp_delta=None, check_channel=False, check_direction=False)
    with pytest.raises(can.CanOperationError):
        one.send(can.Message(arbitration_id=1, is_fd=True, is_extended_id=False))


def test_filters_are_applied(serve: Serve, join: Join) -> None:
    hub = serve(realtime=True)
    sender = join(hub)
    filtered = join(hub, can_filters=[{"can_id": 0x181, "can_mask": 0x7FF}])
    for can_id in (0x080, 0x182, 0x181):
        sender.send(message(can_id))
    got = filtered.recv(5.0)
    assert got is not None
    assert got.arbitration_id == 0x181


def test_real_time_uses_the_wall_clock_and_its_stamps(serve: Serve, join: Join) -> None:
    hub = serve(realtime=True)
    sender, receiver = join(hub, participant=True), join(hub)
    assert sender.simulated_clock is None
    sender.send(message(0x80))
    got = receiver.recv(5.0)
    assert got is not None
    assert abs(got.timestamp - time.time()) < 60.0
    start_s = time.monotonic()
    assert receiver.recv(0.02) is None
    assert time.monotonic() - start_s >= 0.02


@pytest.mark.parametrize("realtime", [False, True])
def test_bus_off_is_python_cans_error(serve: Serve, join: Join, realtime: bool) -> None:
    start_ns = time.monotonic_ns() if realtime else 0
    script = FaultScript(bus=(AdapterFault(kind="bus_off", at_s=0.0, duration_s=0.5),))
    faults = BusFaults(script, {"base": 1}, 127, {}, start_ns)
    bus = join(serve(realtime=realtime, faults=faults), participant=True)
    bus.send(message(0x80))
    with pytest.raises(can.CanOperationError):
        bus.receive_frames(10.0)


def test_continuous_polling_does_not_stop_simulated_time(serve: Serve, join: Join) -> None:
    bus = join(serve(), participant=True)
    clock = bus.simulated_clock
    assert clock is not None
    for _ in range(100_000):
        assert bus.recv(0) is None
        if clock.now_s() >= 1e-5:
            break
    assert clock.now_s() >= 1e-5


def test_the_drivers_transport_joins_as_a_participant(serve: Serve, join: Join) -> None:
    hub = serve()
    observer = join(hub)
    config = CanBusConfig(interface="rid_sim", channel=str(hub.path))
    with open_can(config) as link:
        assert link.simulated
        link.send(SYNC)
        link.send(Frame(0x201, bytes(8)))
        assert link.receive(0.008) is None
        assert link.clock.now_s() == 0.008
        for can_id in (0x080, 0x201):
            received = observer.recv(5.0)
            assert received is not None
            assert received.arbitration_id == can_id


def test_a_notifier_receives_in_its_own_thread(serve: Serve, join: Join) -> None:
    hub = serve(realtime=True)
    sender, receiver = join(hub), join(hub)
    reader = can.BufferedReader()
    notifier = can.Notifier(receiver, [reader], timeout=0.1)
    for number in range(50):
        sender.send(message(0x100 + number))
        receiver.send(message(0x300 + number))
    received = [reader.get_message(5.0) for _ in range(50)]
    notifier.stop()
    assert [m.arbitration_id for m in received if m] == list(range(0x100, 0x132))
    replies = [sender.recv(5.0) for _ in range(50)]
    assert [m.arbitration_id for m in replies if m] == list(range(0x300, 0x332))


def test_a_name_is_looked_up_in_the_runtime_directory(
    tmp_path: Path, serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    hub = serve()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    (tmp_path / "rid-daq").mkdir(mode=0o700)
    os.link(hub.path, tmp_path / "rid-daq" / "mycell.sock")
    with can.Bus(interface="rid_sim", channel="mycell", ignore_config=True) as bus:
        assert "mycell.sock" in str(bus)


def test_a_missing_bus_is_python_cans_error(tmp_path: Path) -> None:
    with pytest.raises(can.CanInitializationError):
        can.Bus(interface="rid_sim", channel=str(tmp_path / "no.sock"), ignore_config=True)


def test_a_hub_that_has_ended_is_python_cans_error(serve: Serve, join: Join) -> None:
    bus = join(serve(), participant=True)
    assert isinstance(bus._client, HubClient)
    bus._client._socket.shutdown(2)
    with pytest.raises(can.CanOperationError):
        bus.recv(1.0)


def test_frames_sent_before_the_hub_ended_are_received_before_the_error(tmp_path: Path) -> None:
    sent = [WireFrame(number, number, 1, 0, bytes([number])) for number in range(1, 4)]

    def open_bus_of_an_ended_hub() -> RidSimBus:
        path = tmp_path / "ended.sock"
        with listening_socket(path) as listener, ThreadPoolExecutor(1) as pool:
            opening = pool.submit(can.Bus, interface="rid_sim", channel=str(path))
            listener.setblocking(True)
            hub, _ = listener.accept()
            with hub:
                hub.recv(100)
                hub.send(pack(PacketKind.WELCOME))
                for frame in sent:
                    hub.send(pack(PacketKind.FRAMES) + FRAME.pack(*frame))
            bus = opening.result()
        assert isinstance(bus, RidSimBus)
        return bus

    with open_bus_of_an_ended_hub() as bus:
        messages = [bus.recv(1.0) for _ in sent]
        assert [message and message.arbitration_id for message in messages] == [1, 2, 3]
        with pytest.raises(can.CanOperationError):
            bus.recv(1.0)
    with open_bus_of_an_ended_hub() as bus:
        arrivals = bus.receive_frames(1.0)
        assert arrivals is not None
        assert [arrival.cob_id for arrival in arrivals] == [1, 2, 3]
        with pytest.raises(can.CanOperationError):
            bus.receive_frames(1.0)


def test_python_cans_logger_receives_frames(serve: Serve, join: Join) -> None:
    hub = serve()
    command = [sys.executable, "-m", "can.logger", "-i", "rid_sim", "-c", str(hub.path)]
    environment = os.environ | {"PYTHONUNBUFFERED": "1"}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as logger:
        assert logger.stdout is not None
        assert "Connected" in logger.stdout.readline()
        bus = join(hub, participant=True)
        clock = bus.simulated_clock
        assert clock is not None
        for cycle in range(1, 101):
            bus.send(message(0x80))
            clock.sleep_until(cycle * 0.008)
        frames = (line for line in logger.stdout if "ID:" in line)
        received = [next(frames) for _ in range(100)]
        logger.send_signal(signal.SIGINT)
        logger.stdout.read()
    assert all("ID:      080" in line for line in received)
    assert f"Timestamp: {99 * 0.008 + 48e-6:15.6f}" in received[99]
