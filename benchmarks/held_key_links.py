"""Simulated links between a page and a service, and a page that holds a key."""

from __future__ import annotations

import heapq
import itertools
import random
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Protocol

Message = dict[str, Any]

RTO_S: Final = 0.2
"""Shortest retransmission timeout of TCP in Linux [s]."""

LIMIT_S: Final = 0.3  # LIMIT_MS of held_key.js


class Way(Protocol):
    """One direction of a link."""

    def send(self, now_s: float, message: Message) -> None:
        """Send a message."""

    def arrived(self, now_s: float) -> list[Message]:
        """Return the messages that have arrived since the last call."""


class DisturbedWay:
    """One direction of a link, with any delay per message, reordering and repetition.

    Args:
        arrival_s: Function from the time of sending to the time of arrival [s].
        ordered: True if a message cannot overtake earlier ones.
        again_s: Time from the arrival of each message to its repetition [s]; None for none.
    """

    def __init__(
        self,
        arrival_s: Callable[[float], float],
        *,
        ordered: bool = True,
        again_s: float | None = None,
    ) -> None:
        self._arrival_s = arrival_s
        self._ordered = ordered
        self._again_s = again_s
        self._latest_s = 0.0
        self._numbers = itertools.count()
        self._waiting: list[tuple[float, int, Message]] = []

    def send(self, now_s: float, message: Message) -> None:
        """Send a message."""
        arrives_s = self._arrival_s(now_s)
        if self._ordered:
            arrives_s = self._latest_s = max(arrives_s, self._latest_s)
        heapq.heappush(self._waiting, (arrives_s, next(self._numbers), message))
        if self._again_s is not None:
            again = (arrives_s + self._again_s, next(self._numbers), message)
            heapq.heappush(self._waiting, again)

    def arrived(self, now_s: float) -> list[Message]:
        """Return the messages that have arrived since the last call."""
        found = []
        while self._waiting and self._waiting[0][0] <= now_s:
            found.append(heapq.heappop(self._waiting)[2])
        return found


@dataclass
class _Packet:
    message: Message
    sent_s: float
    arrives_s: float | None  # None while the packet counts as lost
    timeout_s: float


class LossyWay:
    """Direction of a TCP connection with packet loss; a lost packet delays the following packets.

    A packet is sent again after its timeout, or when `later` packets that were sent after it are
    known to have arrived. Each message is one packet.

    Args:
        latency_s: One-way latency [s], also of acknowledgements, which are never lost.
        loss: Fraction of lost packets.
        chance: Random generator that selects the lost packets.
        later: 1 as in Linux and Windows (RACK, RFC 8985, which also waits for a quarter of the
            round trip); 3 as in older systems (fast retransmit, RFC 5681).
    """

    def __init__(self, latency_s: float, loss: float, chance: random.Random, later: int) -> None:
        self._latency_s = latency_s
        self._loss = loss
        self._chance = chance
        self._later = later
        self._packets: deque[_Packet] = deque()

    def send(self, now_s: float, message: Message) -> None:
        """Send a message."""
        timeout_s = 2.0 * self._latency_s + RTO_S
        self._packets.append(_Packet(message, now_s, self._try(now_s), timeout_s))

    def arrived(self, now_s: float) -> list[Message]:
        """Return the messages that have arrived since the last call."""
        for packet in self._packets:
            if packet.arrives_s is None:
                self._resend_lost(packet, now_s)
        found = []
        while self._packets:
            arrives_s = self._packets[0].arrives_s
            if arrives_s is None or arrives_s > now_s:
                break
            found.append(self._packets.popleft().message)
        return found

    def _resend_lost(self, packet: _Packet, now_s: float) -> None:
        """Send a lost packet again if its loss has been detected."""
        waited_s = now_s - packet.sent_s
        if waited_s < 2.5 * self._latency_s:
            return
        later = sum(
            each.arrives_s is not None
            and each.sent_s > packet.sent_s
            and each.arrives_s + self._latency_s <= now_s
            for each in self._packets
        )
        if waited_s >= packet.timeout_s:
            packet.timeout_s *= 2.0
        elif later < self._later:
            return
        packet.sent_s, packet.arrives_s = now_s, self._try(now_s)

    def _try(self, now_s: float) -> float | None:
        return None if self._chance.random() < self._loss else now_s + self._latency_s


class NarrowWay:
    """One direction of a link, with a limited bandwidth.

    Args:
        each_s: Transmission time of a message [s].
    """

    def __init__(self, each_s: float) -> None:
        self._each_s = each_s
        self._free_s = 0.0
        self._way = DisturbedWay(lambda _sent_s: self._free_s)

    def send(self, now_s: float, message: Message) -> None:
        """Send a message."""
        self._free_s = max(self._free_s, now_s) + self._each_s
        self._way.send(now_s, message)

    def arrived(self, now_s: float) -> list[Message]:
        """Return the messages that have arrived since the last call."""
        return self._way.arrived(now_s)


class Page:
    """A page that follows the rules of `held_key.js`, or a careless program.

    Args:
        to_service: Link in the direction to the service.
        careless: True for a program that continues a press after a gap and after a reconnection.
    """

    def __init__(self, to_service: Way, *, careless: bool) -> None:
        self.to_service = to_service
        self.ended = 0  # presses that the page itself has ended
        self._careless = careless
        self._sequence = 0
        self._newest: tuple[Any, float] | None = None
        self._press: tuple[str, float] | None = None
        self._counts = False

    def hold(self, key: str, now_s: float) -> None:
        """Press a button."""
        self._press, self._counts = (key, now_s), True
        self._say(now_s, held="")
        if self._age(now_s) < LIMIT_S or self._careless:
            self._say(now_s, held=key)

    def release(self, now_s: float) -> None:
        """Release the button."""
        self._press = None
        self._say(now_s, held="")

    def receive(self, message: Message, now_s: float) -> None:
        """Receive a challenge and answer it while a button is pressed."""
        self.watch(now_s)
        self._newest = message["value"], now_s
        if self._press is not None and self._counts:
            self._say(now_s, held=self._press[0])

    def watch(self, now_s: float) -> None:
        """End a press after a gap."""
        if self._press is None or not self._counts or self._careless:
            return
        if min(self._age(now_s), now_s - self._press[1]) >= LIMIT_S:
            self._counts = False
            self.ended += 1

    def connect(self, to_service: Way) -> None:
        """Switch to another connection."""
        self.to_service, self._newest = to_service, None
        self._counts = self._counts and self._careless

    def _age(self, now_s: float) -> float:
        return LIMIT_S if self._newest is None else now_s - self._newest[1]

    def _say(self, now_s: float, **key: str) -> None:
        self._sequence += 1
        challenge = None if self._newest is None else self._newest[0]
        self.to_service.send(now_s, {**key, "sequence": self._sequence, "challenge": challenge})
