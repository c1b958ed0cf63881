"""`EmbeddedClient`: connects devices to a lock-step hub in the same process.

It has the methods of `HubClient`. Devices and hub exchange frames by function calls, and the hub
runs while the devices wait.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence

from config.errors import TransportError
from mock_hw.bus.arbitration import FOREVER_NS, WireFrame
from mock_hw.bus.hub import CanHub
from mock_hw.bus.hub_member import HubMember
from mock_hw.bus.hub_protocol import HubRole, PacketKind

_DATA_BYTES = 8
_LOOK_S = 0.1
_UNHEARD_S = 0.001
"""Longest time for which the hub does not read its other clients while waits follow each other
without a pause [s]."""


class EmbeddedClient(HubMember):
    """Connection of devices to a lock-step hub that runs in their process.

    Args:
        hub: The hub.
        urgent: Identifiers whose frames end every wait immediately, as for `HubClient`.
        ended: Called at every wait, and ten times per second during a wait; if it returns True, the
            client ends.

    Attributes:
        hub: The hub.
        lockstep: Always True.
        now_ns: The simulated time at the end of the last wait [ns].
    """

    lockstep = True

    def __init__(self, hub: CanHub, urgent: Iterable[int], ended: Callable[[], bool]) -> None:
        super().__init__()
        self.urgent = frozenset(urgent)
        self.hub = hub
        self._ended = ended
        self._outbox: list[WireFrame] = []
        self._received: list[WireFrame] = []
        self._received_s = 0.0
        self.now_ns = 0
        hub.add(self, HubRole.DEVICE)

    def send(self, kind: PacketKind, flag: int, now_ns: int) -> None:
        """Store the frames of the inbox, which `end_wait` returns."""
        del kind, flag
        self._received += self.inbox
        self.now_ns = now_ns

    def post(self, can_id: int, data: bytes, length: int, port: int = 0, time_ns: int = 0) -> None:
        """Put a frame into the outbox; its transmission starts at `time_ns` or later."""
        self._outbox.append(
            WireFrame(time_ns, can_id, length, port, data.ljust(_DATA_BYTES, b"\0"))
        )

    def wait(self, until_ns: int = FOREVER_NS, on_frames: bool = True) -> list[WireFrame]:
        """Send the outbox; let time advance to `until_ns`, or until frames arrive.

        Returns:
            Frames that were on the bus during the wait, oldest first; data padded to 8 bytes.

        Raises:
            TransportError: `ended` returned True: the client must end.
        """
        self.begin_wait(until_ns, on_frames)
        self.serve(())
        return self.end_wait()

    def begin_wait(self, until_ns: int = FOREVER_NS, on_frames: bool = True) -> None:
        """Begin a `wait`: until its end, the devices do not stop simulated time."""
        outbox, self._outbox = self._outbox, []
        self.hub.begin_wait(self, outbox, until_ns, on_frames=on_frames)

    def serve(self, fds: Sequence[int], master: HubMember | None = None) -> bool:
        """Run the hub; return True when the wait is over, False when one of `fds` is readable.

        Args:
            fds: File descriptors that end the call.
            master: Master in this process; the call also ends when its wait is over.

        Raises:
            TransportError: `ended` returned True: the client must end.
        """
        hub, now_s = self.hub, time.monotonic()
        if now_s - self._received_s > _UNHEARD_S and self._receive(fds, now_s):
            return False
        while not self._ended():
            hub.advance(now_s)
            if not self.idle or (master is not None and not master.idle):
                return True
            if self._receive(fds, now_s + _LOOK_S):
                return False
            now_s = self._received_s
        raise TransportError("the simulated bus has ended", code="RID-MOCK-ENDED")

    def _receive(self, fds: Sequence[int], until_s: float) -> bool:
        readable = self.hub.receive(fds, until_s)
        self._received_s = time.monotonic()
        return bool(readable)

    def end_wait(self) -> list[WireFrame]:
        """Return the frames that arrived during a wait that is over."""
        received, self._received = self._received, []
        return received

    def close(self) -> None:
        """Discard the outbox; the hub is closed elsewhere."""
        self._outbox.clear()
