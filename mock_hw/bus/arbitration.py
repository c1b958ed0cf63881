"""`CanWire`: one CAN segment with queues, arbitration and transmission; it reads no clock."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from mock_hw.bus.wire_time import (
    EXTENDED_FLAG,
    EXTENDED_MASK,
    INTERMISSION_BITS,
    REMOTE_FLAG,
    arbitration_key,
    wire_bits,
)

FOREVER_NS = 2**62
"""Time in the far future that means never [ns]."""

Source = tuple[int, int]
"""Sender of a frame: number of a hub's client, and number of a CAN controller (port) of this
client."""


class WireFrame(NamedTuple):
    """A CAN frame with a time.

    Attributes:
        time_ns: Of a frame to send: earliest time of transmission. Of a received frame: time of
            reception [ns].
        can_id: CAN identifier with the flags of SocketCAN.
        length: Data length code.
        port: Number of the CAN controller that sends it; a client can have several controllers.
        data: Data bytes.
    """

    time_ns: int
    can_id: int
    length: int
    port: int
    data: bytes


class Delivery(NamedTuple):
    """A frame whose transmission has ended at its `time_ns`, with its sender."""

    source: Source
    frame: WireFrame


def candump_line(frame: WireFrame, time_ns: int, channel: str) -> str:
    """Return a frame as a line in candump's log format; `channel` is the name of the bus."""
    width, identifier = 3, frame.can_id
    if frame.can_id & EXTENDED_FLAG:
        width, identifier = 8, frame.can_id & EXTENDED_MASK
    data = frame.data[: frame.length].hex().upper()
    if frame.can_id & REMOTE_FLAG:
        identifier, data = identifier & ~REMOTE_FLAG, f"R{frame.length}"
    seconds, microseconds = divmod(time_ns // 1000, 1_000_000)
    return f"({seconds:010d}.{microseconds:06d}) {channel} {identifier:0{width}X}#{data}\n"


class CanWire:
    """A bus that transmits one frame at a time, the lowest identifier first.

    Every source has a queue and offers the oldest frame in it, like a CAN controller with a
    first-in first-out queue. When the bus becomes free, it transmits the frame that wins the
    arbitration among all frames that are ready. Of frames with equal identifiers, the one from the
    source with the lower number is transmitted first.

    Args:
        bitrate: Nominal bit rate [bit/s].
    """

    def __init__(self, bitrate: int) -> None:
        self._bit_ns = 1e9 / bitrate
        self._queues: dict[Source, deque[WireFrame]] = {}
        self._free_ns = 0
        self._sending: Delivery | None = None
        self.next_ns = FOREVER_NS
        """Time at which `step` is due: end of the present frame, or start of the next frame
        [ns]."""

    @property
    def sending(self) -> bool:
        """True during a transmission, which ends at `next_ns`."""
        return self._sending is not None

    def queue(self, source: Source, frame: WireFrame, now_ns: int) -> None:
        """Queue a frame for transmission at `frame.time_ns` or `now_ns`, whichever is later."""
        queue = self._queues.get(source)
        ready_ns = max(frame.time_ns, now_ns)
        if queue is None:
            queue = self._queues[source] = deque()
        elif queue:
            ready_ns = max(ready_ns, queue[-1].time_ns)
        queue.append(frame if ready_ns == frame.time_ns else WireFrame(ready_ns, *frame[1:]))
        if self._sending is None:
            self._look_ahead()

    def backlog(self, now_ns: int) -> bool:
        """Return True if a transmission is running, or the next one starts without a pause."""
        return self._sending is not None or self.next_ns <= max(now_ns, self._free_ns)

    def step(self) -> Delivery | None:
        """End the present frame and return it; without one, start the next, and return None."""
        delivery = self._sending
        if delivery is not None:
            self._sending = None
            self._look_ahead()
            return delivery
        self._start(self.next_ns)
        return None

    def _look_ahead(self) -> None:
        earliest_ns = FOREVER_NS
        for queue in self._queues.values():
            if queue[0].time_ns < earliest_ns:
                earliest_ns = queue[0].time_ns
        self.next_ns = max(earliest_ns, self._free_ns)

    def _start(self, start_ns: int) -> None:
        ready = [
            (arbitration_key(queue[0].can_id), source)
            for source, queue in self._queues.items()
            if queue[0].time_ns <= start_ns
        ]
        _, winner = min(ready)
        queue = self._queues[winner]
        frame = queue.popleft()
        if not queue:
            del self._queues[winner]
        data = b"" if frame.can_id & REMOTE_FLAG else frame.data[: frame.length]
        bits = wire_bits(frame.can_id, data, frame.length)
        self._free_ns = start_ns + round(bits * self._bit_ns)
        self.next_ns = start_ns + round((bits - INTERMISSION_BITS) * self._bit_ns)
        self._sending = Delivery(winner, WireFrame(self.next_ns, *frame[1:]))
