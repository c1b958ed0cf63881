"""`CanLink` over python-can: deadlines, typed errors, and frames that are not data frames."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import can
import pytest

from config.cell.cell import CanBusConfig, CellConfig
from config.cell.drive_safety import DriveSafety
from config.errors import TransportError
from drivers.canopen.frames import SYNC, Frame
from drivers.canopen.heartbeat import guard_request
from drivers.ports.can_link import CanLink, open_can
from drivers.ports.clock import MonotonicClock
from drivers.servo.cyclic_exchange import CyclicExchange
from drivers.servo.drive_watch import DriveWatch
from tests.builders.raised_codes import raises_code

if TYPE_CHECKING:
    from tests.drivers.conftest import Bench


@pytest.fixture
def link() -> Iterator[CanLink]:
    with open_can(CanBusConfig(interface="virtual", channel="transport")) as opened:
        yield opened


@pytest.fixture
def peer() -> Iterator[can.BusABC]:
    with can.Bus(interface="virtual", channel="transport") as bus:
        yield bus


def message(cob_id: int, data: bytes = b"", **kwargs: Any) -> can.Message:
    return can.Message(arbitration_id=cob_id, data=data, **({"is_extended_id": False} | kwargs))


def test_frames_are_sent_and_received(link: CanLink, peer: can.BusABC) -> None:
    link.send(Frame(0x201, b"\x06\x00"))
    arrived = peer.recv(1.0)
    assert arrived is not None
    assert (arrived.arbitration_id, bytes(arrived.data)) == (0x201, b"\x06\x00")
    assert not arrived.is_extended_id
    peer.send(message(0x181, b"\x37"))
    before_s = link.clock.now_s()
    assert link.receive(before_s + 1.0) == Frame(0x181, b"\x37")
    assert before_s <= link.last_time_s <= link.clock.now_s()


def test_a_past_deadline_still_returns_a_waiting_frame(link: CanLink, peer: can.BusABC) -> None:
    assert link.receive(float("-inf")) is None
    peer.send(message(0x181))
    assert link.receive(link.clock.now_s() - 5.0) == Frame(0x181, b"")


def test_a_device_can_be_polled_by_a_remote_frame(link: CanLink, peer: can.BusABC) -> None:
    link.send(guard_request(3))
    request = peer.recv(1.0)
    assert request is not None
    assert (request.arbitration_id, request.is_remote_frame, request.dlc) == (0x703, True, 1)
    link.take_remote_frames()
    peer.send(message(0x703, is_remote_frame=True, dlc=1))
    assert link.receive(link.clock.now_s() + 1.0) == guard_request(3)


def test_only_classic_data_frames_are_returned(link: CanLink, peer: can.BusABC) -> None:
    peer.send(message(0x181, is_extended_id=True))
    peer.send(message(0x181, is_remote_frame=True))
    peer.send(message(0x004, bytes(8), is_error_frame=True))
    peer.send(message(0x182))
    assert link.receive(link.clock.now_s() + 1.0) == Frame(0x182, b"")


def test_bus_off_is_an_error(link: CanLink, peer: can.BusABC) -> None:
    peer.send(message(0x040, bytes(8), is_error_frame=True))
    with raises_code(TransportError, "RID-CAN-BUS-OFF"):
        link.receive(link.clock.now_s() + 1.0)


def test_a_closed_bus_is_an_error() -> None:
    link = open_can(CanBusConfig(interface="virtual", channel="gone"))
    link.close()
    with raises_code(TransportError, "RID-CAN-LOST"):
        link.send(SYNC)
    with raises_code(TransportError, "RID-CAN-LOST"):
        link.receive(0.0)


def test_the_clock_is_the_computers_unless_the_bus_has_one(link: CanLink, bench: Bench) -> None:
    assert isinstance(link.clock, MonotonicClock)
    assert not link.simulated
    assert bench.link.simulated
    bench.link.clock.sleep_until(50.0)
    assert bench.link.clock.now_s() == 50.0


def test_an_ended_simulation_is_a_transport_error(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone(time_s: float) -> None:
        raise can.CanOperationError("the hub has ended")

    monkeypatch.setattr(bench.bus, "run_until", gone)
    with raises_code(TransportError, "RID-MOCK-ENDED"):
        bench.link.clock.sleep_until(50.0)


def test_answers_of_the_previous_cycle_are_read_before_sync(
    link: CanLink, peer: can.BusABC, cell: CellConfig
) -> None:
    """If the adapter has no time stamps, a frame that is already waiting at SYNC counts as late."""
    safety: DriveSafety = cell.drive_safety
    watch = DriveWatch(("base",), (1,), safety)
    exchange = CyclicExchange(link, (1,), watch)
    peer.send(message(0x181, struct.pack("<Hih", 0x27, 111, 0)))
    exchange.sync()
    peer.send(message(0x181, struct.pack("<Hih", 0x27, 222, 0)))
    exchange.collect(link.clock.now_s() + 1.0)
    assert exchange.answers.late_frames == 1
    assert exchange.answers.position_counts.tolist() == [222]
