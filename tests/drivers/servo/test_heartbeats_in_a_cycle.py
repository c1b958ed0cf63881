"""Loss of a drive's heartbeat, judged by the frames that were read in a cycle."""

from __future__ import annotations

import struct
from collections.abc import Sequence

import pytest

from config.cell.drive_safety import DriveSafety
from drivers.interfaces.servo_axes import EventKind
from drivers.ports.can_link import CanLink
from drivers.ports.can_ports import Arrival
from drivers.servo.cyclic_exchange import QUICK_STOP_LATENCY_S, CyclicExchange
from drivers.servo.drive_watch import DriveWatch

TIMEOUT_S = 0.1
ANSWER = struct.pack("<Hih", 0x27, 111, 0)
HEARTBEAT = b"\x05"


class Computer:
    """A clock, and a bus that returns one frame per call, like most of python-can's."""

    channel_info = "scripted"

    def __init__(self, *, time_stamped: bool) -> None:
        self.time_stamped = time_stamped
        self.now = 0.0
        self.waiting: list[tuple[int, bytes, float]] = []

    def now_s(self) -> float:
        return self.now

    def sleep_until(self, time_s: float) -> None:
        self.now = max(self.now, time_s)

    def send_frames(self, frames: Sequence[tuple[int, bytes | bytearray]]) -> None:
        pass

    def receive_frames(self, timeout_s: float) -> Sequence[Arrival] | None:
        """Return the next waiting frame, with the time of its arrival or of its reading."""
        if not self.waiting:
            self.now += timeout_s
            return None
        cob_id, data, came_s = self.waiting.pop(0)
        return (Arrival(cob_id, data, came_s if self.time_stamped else self.now),)

    def shutdown(self) -> None:
        pass


def exchange_on(computer: Computer) -> tuple[CyclicExchange, DriveWatch]:
    """Return an exchange with one drive that is watched from time 0."""
    safety = DriveSafety(quick_stop_deceleration_rad_s2=10.0, following_error_rad=0.1)
    assert safety.drive_heartbeat_timeout_ms == 1000.0 * TIMEOUT_S
    watch = DriveWatch(("base",), (1,), safety)
    link = CanLink(computer)
    link.clock = computer
    watch.arm(0.0)
    return CyclicExchange(link, (1,), watch), watch


@pytest.mark.parametrize("time_stamped", [False, True])
def test_a_pause_of_the_computer_is_not_a_lost_heartbeat(time_stamped: bool) -> None:
    """The heartbeat arrived during the program's pause, but the answers are read before the
    heartbeat.
    """
    computer = Computer(time_stamped=time_stamped)
    exchange, watch = exchange_on(computer)
    computer.now = 0.05
    exchange.sync()
    computer.now = 0.15
    computer.waiting = [(0x181, ANSWER, 0.051), (0x701, HEARTBEAT, 0.052)]
    exchange.collect(0.057)
    assert exchange.answers.received.tolist() == [True]
    assert watch.take_events() == ()
    computer.now = 0.16
    exchange.sync()
    computer.waiting.append((0x181, ANSWER, 0.161))
    exchange.collect(0.167)
    lost = [event.kind for event in watch.take_events()]
    assert lost == ([EventKind.HEARTBEAT_LOST] if time_stamped else [])


@pytest.mark.parametrize(("after_s", "lost"), [(0.0, False), (0.0002, True)])
def test_silence_is_judged_when_the_timeout_has_passed(after_s: float, lost: bool) -> None:
    computer = Computer(time_stamped=True)
    exchange, watch = exchange_on(computer)
    computer.now = 0.099
    exchange.sync()
    answered_s = TIMEOUT_S - QUICK_STOP_LATENCY_S - 0.0001 + after_s
    computer.waiting = [(0x181, ANSWER, answered_s)]
    exchange.collect(0.106)
    events = watch.take_events()
    assert [event.kind for event in events] == [EventKind.HEARTBEAT_LOST] * lost
    assert [event.time_s for event in events] == [answered_s] * lost


def test_silence_is_judged_although_an_answer_is_missing() -> None:
    """All frames until the deadline were read, and none was a heartbeat."""
    computer = Computer(time_stamped=True)
    exchange, watch = exchange_on(computer)
    computer.now = 0.096
    exchange.sync()
    exchange.collect(0.102)
    assert [event.kind for event in watch.take_events()] == [EventKind.HEARTBEAT_LOST]
