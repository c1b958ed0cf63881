"""`HubMember`, `SocketMember`: the hub's data about one client."""

from __future__ import annotations

import socket
from abc import ABC, abstractmethod
from collections import deque

from mock_hw.bus.arbitration import FOREVER_NS, WireFrame
from mock_hw.bus.hub_protocol import (
    FRAME,
    FRAMES_PER_PACKET,
    PACKET_BYTES,
    HubRole,
    PacketKind,
    pack,
)

_INBOX_FRAMES = 4096
_BUFFER_BYTES = 1 << 20


class HubMember(ABC):
    """The hub's data about one client: its wait, and the frames for it that are not sent yet.

    Attributes:
        key: Number of the client, in the order in which clients connect.
        role: Role of the client; None until the client has sent HELLO.
        urgent: Identifiers whose frames end every wait immediately.
        own_frames: True if the client receives its own frames after their transmission.
        idle: True while the client waits.
        due_ns: Time at which the wait ends [ns].
        on_frames: True if frames end the wait.
        inbox: Frames for the client since the last `send`.
    """

    def __init__(self) -> None:
        self.key = 0
        self.role: HubRole | None = None
        self.urgent: frozenset[int] = frozenset()
        self.own_frames = False
        self.idle = True
        self.due_ns = FOREVER_NS
        self.on_frames = False
        self.inbox: deque[WireFrame] = deque(maxlen=_INBOX_FRAMES)

    @abstractmethod
    def send(self, kind: PacketKind, flag: int, now_ns: int) -> None:
        """Send the frames of the inbox to the client; the hub then empties the inbox.

        Args:
            kind, flag: As for `hub_protocol.pack`.
            now_ns: The present time [ns].

        Raises:
            OSError: The client has disconnected, or does not read.
        """

    @abstractmethod
    def close(self) -> None:
        """Disconnect the client."""


class SocketMember(HubMember):
    """A client in another process, connected by a SEQPACKET socket.

    Attributes:
        number: Number of the client's last IDLE packet.
    """

    def __init__(self, connection: socket.socket) -> None:
        super().__init__()
        connection.setblocking(False)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER_BYTES)
        self._socket = connection
        self.number = 0

    def fileno(self) -> int:
        """Return the socket's file descriptor."""
        return self._socket.fileno()

    def receive(self) -> bytes:
        """Return the client's next packet; empty if the client has closed the connection.

        Raises:
            OSError: There is no packet, or the connection is broken.
        """
        return self._socket.recv(PACKET_BYTES)

    def send(self, kind: PacketKind, flag: int, now_ns: int) -> None:
        """Send the frames in as many packets as necessary; only the last packet is of `kind`."""
        packed = [FRAME.pack(*frame) for frame in self.inbox]
        while len(packed) > FRAMES_PER_PACKET:
            some, packed = packed[:FRAMES_PER_PACKET], packed[FRAMES_PER_PACKET:]
            self._socket.send(pack(PacketKind.FRAMES) + b"".join(some))
        self._socket.send(pack(kind, flag, self.number, now_ns) + b"".join(packed))

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
