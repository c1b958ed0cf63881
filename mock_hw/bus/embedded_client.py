"""`EmbeddedClient`: devices in the process of a lock-step hub, with the methods of a hub's client.

Devices and hub exchange frames by calls. The hub's loop runs while the devices wait.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence

from config.errors import TransportError
from mock_hw.bus.arbitration import FOREVER_NS, WireFrame
from mock_hw.bus.hub import CanHub
from mock_hw.bus.hub_member import HubMember
from mock_hw.bus.hub_protocol import PacketKind

_DATA_BYTES = 8
_LOOK_S = 0.1
_UNHEARD_S = 0.001
"""Longest time without reading clients, if one wait follows another without a pause [s]."""


class EmbeddedClient(HubMember):
    """The devices of a lock-step hub's own process.

    Args:
        hub: The hub.
        urgent: Identifiers whose frames end any wait at once, as for `HubClient`.
        ended: Called at every wait, and ten times a second during it; True ends the client.

    Attributes:
        lockstep: True: there is simulated time only.
        now_ns: The simulated time at the end of the last wait [ns].
    """

    lockstep = True

    def __init__(self, hub: CanHub, urgent: Iterable[int], ended: Callable[[], bool]) -> None:
        super().__init__()
        self.urgent = frozenset(urgent)
        self._hub = hub
        self._ended = ended
        self._outbox: list[WireFrame] = []
        self._received: list[WireFrame] = []
        self._received_s = 0.0
        self.now_ns = 0
        hub.add_devices(self)

    def send(self, kind: PacketKind, flag: int, now_ns: int) -> None:
        """Keep the frames for `end_wait`."""
        del kind, flag
        self._received += self.inbox
        self.now_ns = now_ns

    def post(self, can_id: int, data: bytes, length: int, port: int = 0, time_ns: int = 0) -> None:
        """Put a frame into the outbox, to be transmitted not before `time_ns`."""
        self._outbox.append(
            WireFrame(time_ns, can_id, length, port, data.ljust(_DATA_BYTES, b"\0"))
        )

    def wait(self, until_ns: int = FOREVER_NS, on_frames: bool = True) -> list[WireFrame]:
        """Send the outbox and let time advance until `until_ns`, or until frames arrive.

        Returns:
            Frames on the bus meanwhile, oldest first; data padded to 8 bytes.

        Raises:
            TransportError: The client must end.
        """
        self.begin_wait(until_ns, on_frames)
        self.serve(())
        return self.end_wait()

    def begin_wait(self, until_ns: int = FOREVER_NS, on_frames: bool = True) -> None:
        """Begin a `wait`: from now on the devices do not stop time."""
        outbox, self._outbox = self._outbox, []
        self._hub.begin_wait(self, outbox, until_ns, on_frames=on_frames)

    def serve(self, fds: Sequence[int]) -> bool:
        """Run the hub until the wait is over (True), or one of `fds` is readable (False).

        Raises:
            TransportError: The client must end.
        """
        hub, now_s = self._hub, time.monotonic()
        if now_s - self._received_s > _UNHEARD_S and self._receive(fds, now_s):
            return False
        while not self._ended():
            hub.advance(now_s)
            if not self.idle:
                return True
            if self._receive(fds, now_s + _LOOK_S):
                return False
            now_s = self._received_s
        raise TransportError("the simulated bus has ended", code="RID-MOCK-ENDED")

    def _receive(self, fds: Sequence[int], until_s: float) -> bool:
        readable = self._hub.receive(fds, until_s)
        self._received_s = time.monotonic()
        return bool(readable)

    def end_wait(self) -> list[WireFrame]:
        """Return the frames of a wait that is over."""
        received, self._received = self._received, []
        return received

    def close(self) -> None:
        """Send nothing more; the hub closes with its process."""
        self._outbox.clear()
