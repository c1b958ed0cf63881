"""`EmbeddedMaster`: a master in the process of a lock-step hub and its devices.

Master, hub and devices exchange frames by function calls in one thread: while the master waits, hub
and devices run. Decision 0091 gives the reasons.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from config.errors import TransportError
from mock_hw.bus.arbitration import FOREVER_NS, WireFrame
from mock_hw.bus.hub import CanHub
from mock_hw.bus.hub_member import HubMember
from mock_hw.bus.hub_protocol import HubRole, PacketKind

_DATA_BYTES = 8


@dataclass(frozen=True)
class HostedHub:
    """A hub whose process runs masters too.

    Attributes:
        hub: The hub.
        run_devices: Function that runs hub and devices until the given master's wait is over, or
            until the devices have acted once.
    """

    hub: CanHub
    run_devices: Callable[[HubMember], None]


_HOSTED: Final[dict[Path, HostedHub]] = {}


@contextlib.contextmanager
def hub_joined_by_calls(path: Path, hosted: HostedHub) -> Iterator[None]:
    """Connect masters of this process to a hub by function calls during the `with` block.

    Args:
        path: The hub's socket, by which masters name the hub.
        hosted: The hub.
    """
    _HOSTED[path] = hosted
    try:
        yield
    finally:
        del _HOSTED[path]


def find_hosted_hub(path: Path) -> HostedHub | None:
    """Return the hub with a socket, if this process runs its masters; otherwise None."""
    return _HOSTED.get(path)


class EmbeddedMaster(HubMember):
    """Connection of a master to a lock-step hub in the same process, with `HubClient`'s methods.

    Args:
        hosted: The hub and its devices.
        own_frames: True to receive the master's own frames after their transmission.

    Attributes:
        lockstep, simulated_time: Always True.
        now_ns: The simulated time at the end of the last wait [ns].

    Raises:
        TransportError: The master's adapter is unplugged, or the simulated bus ends.
    """

    lockstep = simulated_time = True

    def __init__(self, hosted: HostedHub, *, own_frames: bool = False) -> None:
        super().__init__()
        self.own_frames = own_frames
        self._hosted = hosted
        self._outbox: list[WireFrame] = []
        self._received: list[WireFrame] = []
        self._is_connected = True
        self.now_ns = 0
        hosted.hub.add(self, HubRole.MASTER)
        self._wait_for_hub()

    def fileno(self) -> int:
        """Return -1: there is no file descriptor to wait for."""
        return -1

    def send(self, kind: PacketKind, flag: int, now_ns: int) -> None:
        """Store the frames of the inbox, which `wait` returns."""
        del kind, flag
        self._received += self.inbox
        self.now_ns = now_ns

    def post(self, can_id: int, data: bytes, length: int) -> None:
        """Put a frame into the outbox; it is sent at the next `wait`."""
        self._outbox.append(WireFrame(0, can_id, length, 0, data.ljust(_DATA_BYTES, b"\0")))

    def wait(self, until_ns: int = FOREVER_NS, on_frames: bool = True) -> list[WireFrame]:
        """Send the outbox; let time advance to `until_ns`, or until frames arrive.

        Returns:
            Frames that were on the bus during the wait, oldest first; data padded to 8 bytes.

        Raises:
            TransportError: The hub has disconnected this master, or the simulated bus ends.
        """
        outbox, self._outbox = self._outbox, []
        self._hosted.hub.begin_wait(self, outbox, until_ns, on_frames=on_frames)
        self._wait_for_hub()
        received, self._received = self._received, []
        return received

    def close(self) -> None:
        """Send the outbox and leave the bus; the hub also calls this to disconnect the master."""
        if self._is_connected:
            self._is_connected = False
            outbox, self._outbox = self._outbox, []
            self._hosted.hub.begin_wait(self, outbox, FOREVER_NS, on_frames=True)
            self._hosted.hub.drop(self)

    def _wait_for_hub(self) -> None:
        while self.idle and self._is_connected:
            self._hosted.run_devices(self)
        if not self._is_connected:
            raise TransportError(
                "simulated CAN bus: the hub has ended the connection", code="RID-MOCK-ENDED"
            )
