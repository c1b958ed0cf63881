"""Requirements of python-can on every interface: two connected buses, and reception of own frames.

Source: the back-to-back suite in python-can's repository (not part of its package), clause by
clause for classic CAN; the messages pass through python-can's own classes.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any

import can
import pytest

Serve = Callable[..., Any]
Pair = tuple[can.BusABC, can.BusABC]

PATIENCE_S = 20.0


def open_bus(hub: Any, **options: Any) -> can.BusABC:
    return can.Bus(interface="rid_sim", channel=str(hub.path), ignore_config=True, **options)


@pytest.fixture(params=["observer", "participant"])
def pair(request: pytest.FixtureRequest, serve: Serve) -> Iterator[Pair]:
    """Two buses on one hub, in real time."""
    hub = serve(realtime=True)
    roles: dict[str, Any] = {"participant": request.param == "participant"}
    with open_bus(hub, **roles) as one, open_bus(hub, **roles) as other:
        yield one, other


FRAMES = [
    can.Message(is_extended_id=False, arbitration_id=0x100, data=[1, 2, 3, 4, 5, 6, 7, 8]),
    can.Message(is_extended_id=True, arbitration_id=0x123456, data=[3, 1, 4, 1, 5, 9, 2, 6]),
    can.Message(is_extended_id=False, arbitration_id=0x300, is_remote_frame=True, dlc=4),
    can.Message(is_extended_id=True, arbitration_id=0x1BA, is_remote_frame=True, dlc=8),
    can.Message(is_extended_id=False, arbitration_id=0x6EF),
    can.Message(is_extended_id=False, arbitration_id=0x300, data=[4, 5, 6]),
]


@pytest.mark.parametrize("message", FRAMES, ids=str)
def test_a_message_arrives_in_both_directions(pair: Pair, message: can.Message) -> None:
    for sender, receiver in (pair, pair[::-1]):
        sender.send(message)
        got = receiver.recv(PATIENCE_S)
        assert got is not None
        assert got.equals(message, timestamp_delta=None, check_channel=False, check_direction=False)
        assert got.is_rx
        assert receiver.recv(0) is None, "it arrives once"
    assert pair[0].recv(0) is None, "a sender receives its own frames only on request"


def test_time_stamps_increase(pair: Pair) -> None:
    sender, receiver = pair
    for number in range(3):
        sender.send(can.Message(arbitration_id=number, is_extended_id=False))
    stamps = [got.timestamp for _ in range(3) if (got := receiver.recv(PATIENCE_S))]
    assert len(stamps) == 3
    assert stamps == sorted(stamps)
    assert len(set(stamps)) == 3


@pytest.mark.parametrize("realtime", [True, False])
def test_a_bus_can_receive_its_own_messages_unchanged(serve: Serve, realtime: bool) -> None:
    hub = serve(realtime=realtime)
    with (
        open_bus(hub, receive_own_messages=True, participant=not realtime) as echoing,
        open_bus(hub) as other,
    ):
        message = can.Message(arbitration_id=0x123, is_extended_id=False, data=[1, 2, 3])
        echoing.send(message)
        mine, theirs = echoing.recv(PATIENCE_S), other.recv(PATIENCE_S)
        assert mine is not None
        assert theirs is not None
        for got in (mine, theirs):
            assert got.equals(message, None, check_channel=False, check_direction=False)
        assert not mine.is_rx
        assert theirs.is_rx
        assert mine.timestamp == pytest.approx(theirs.timestamp, abs=0.01)
        if realtime:
            other.send(message)
            got_from_other = echoing.recv(PATIENCE_S)
            assert got_from_other is not None
            assert got_from_other.is_rx


def test_filters_apply_to_own_messages_too(serve: Serve) -> None:
    only = [{"can_id": 0x181, "can_mask": 0x7FF, "extended": False}]
    with open_bus(serve(realtime=True), receive_own_messages=True, can_filters=only) as bus:
        for can_id in (0x180, 0x181):
            bus.send(can.Message(arbitration_id=can_id, is_extended_id=False))
        got = bus.recv(PATIENCE_S)
        assert got is not None
        assert got.arbitration_id == 0x181


def test_a_periodic_message_is_sent_until_it_is_stopped(pair: Pair) -> None:
    sender, receiver = pair
    message = can.Message(arbitration_id=0x401, is_extended_id=False, data=[1])
    task = sender.send_periodic(message, 0.005)
    assert isinstance(task, can.CyclicSendTaskABC)
    try:
        got = [receiver.recv(PATIENCE_S) for _ in range(3)]
    finally:
        task.stop()
    assert [each.arbitration_id for each in got if each] == [0x401] * 3


def test_a_thread_safe_bus_sends_from_many_threads(serve: Serve) -> None:
    hub = serve(realtime=True)
    count, workers = 50, 4
    with (
        can.ThreadSafeBus(interface="rid_sim", channel=str(hub.path), ignore_config=True) as one,
        open_bus(hub) as other,
    ):

        def send(worker: int) -> None:
            for number in range(count):
                one.send(can.Message(arbitration_id=256 * worker + number, is_extended_id=False))

        threads = [threading.Thread(target=send, args=(worker,)) for worker in range(workers)]
        for thread in threads:
            thread.start()
        got = [other.recv(PATIENCE_S) for _ in range(count * workers)]
        for thread in threads:
            thread.join()
    identifiers = sorted(each.arbitration_id for each in got if each)
    assert identifiers == [256 * w + n for w in range(workers) for n in range(count)]


def test_a_bus_can_be_shut_down_twice(serve: Serve) -> None:
    hub = serve(realtime=True)
    bus = open_bus(hub)
    bus.shutdown()
    bus.shutdown()
    with open_bus(hub) as one, open_bus(hub) as other:
        one.send(can.Message(arbitration_id=0x12, is_extended_id=False))
        got = other.recv(PATIENCE_S)
    assert got is not None
    assert got.arbitration_id == 0x12
