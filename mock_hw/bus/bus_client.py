"""`BusClient`: connects simulated devices to any CAN bus, with the methods of `HubClient`."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable

from config.errors import TransportError
from drivers.ports.can_link import CanLink
from mock_hw.bus.arbitration import FOREVER_NS, WireFrame

DEAD_BUS_S = 0.005
"""Pause after a failed attempt to read the bus [s]."""


class BusClient:
    """A connection to an existing bus, such as SocketCAN, in real time.

    Frames are sent as soon as possible. The earliest transmission time that a device gives to a
    frame is ignored: it would delay the frame by a few tenths of a millisecond, which is less than
    the delays of such a bus.

    Args:
        link: The open bus.
        ended: Called at every wait; if it returns True, the client ends.

    Attributes:
        lockstep: Always False, because an existing bus runs in real time.
        now_ns: CLOCK_MONOTONIC at the last `wait` [ns].
    """

    lockstep = False

    def __init__(self, link: CanLink, ended: Callable[[], bool]) -> None:
        self._link = link
        link.take_remote_frames()
        self._ended = ended
        self._outbox: list[tuple[int, bytes]] = []
        self.now_ns = time.monotonic_ns()

    def fileno(self) -> int:
        """Return the file descriptor to wait for."""
        return self._link.fileno()

    def post(self, can_id: int, data: bytes, length: int, port: int = 0, time_ns: int = 0) -> None:
        """Put a frame into the outbox, to be sent with the next `wait`."""
        del port, time_ns
        self._outbox.append((can_id, data[:length]))

    def wait(self, until_ns: int = FOREVER_NS, on_frames: bool = True) -> list[WireFrame]:
        """Send the outbox; wait until `until_ns` or until frames arrive; return the frames.

        Raises:
            TransportError: `ended` returned True: the client must end.
        """
        del on_frames  # in real time, frames always end the wait
        if self._ended():
            raise TransportError("the simulated devices have ended", code="RID-MOCK-ENDED")
        if self._outbox:
            with contextlib.suppress(TransportError):  # a dead bus loses frames
                self._link.send_frames(self._outbox)
            self._outbox.clear()
        frames: list[WireFrame] = []
        until_s = until_ns * 1e-9
        try:
            while (frame := self._link.receive(until_s)) is not None:
                time_ns = round(self._link.last_time_s * 1e9)
                frames.append(WireFrame(time_ns, frame.cob_id, len(frame.data), 0, frame.data))
                until_s = -math.inf
        except TransportError:  # the interface may come up again
            time.sleep(DEAD_BUS_S)
        self.now_ns = time.monotonic_ns()
        return frames

    def close(self) -> None:
        """Leave the bus."""
        with contextlib.suppress(TransportError):
            self._link.close()
