"""`Door`, `Limits`: a listener's connections, by what they are at, and who goes for whom."""

from __future__ import annotations

import asyncio
import ssl
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rid_daq.web.reception import Reception
from rid_daq.web.room import Room

if TYPE_CHECKING:
    from rid_daq.web.connection import Connection


@dataclass(frozen=True)
class Limits:
    """What clients may take, at each listener.

    An owner is the token that a client shows, or else its address. Where there is no place, the
    oldest connection of the owner with the most goes for the new one.

    Attributes:
        waiting: Connections whose request's head is not whole yet, TLS handshakes among them.
        answering: Connections that are being answered.
        streams, streams_of_one: WebSockets and streams of events, of all and of one owner, who gets
            503 for one more.
        leaving: Connections whose answer is given but not yet taken.
        lines, lines_of_one: Lines of the reception (STOP), of all and of one owner.
        head_bytes, body_bytes: Of a request; the reception may allow another body.
        message_bytes: Of a WebSocket's message.
        stream_bytes, stream_bytes_s: What a client may send over a WebSocket at once, and in a
            second.
        request_s: From the connection to the request's last byte [s]; the reception may allow
            longer bodies.
        answer_s, stream_s: How long a client may take nothing of what is there for it [s].
    """

    waiting: int = 128
    answering: int = 32
    streams: int = 32
    streams_of_one: int = 32
    leaving: int = 256
    lines: int = 256
    lines_of_one: int = 16
    head_bytes: int = 16 << 10
    body_bytes: int = 1 << 20
    message_bytes: int = 64 << 10
    stream_bytes: int = 256 << 10
    stream_bytes_s: int = 64 << 10
    request_s: float = 2.0
    answer_s: float = 5.0
    stream_s: float = 10.0


class Door:
    """A listener's connections, by what they are at.

    Args:
        limits: How many there may be.
        speaker: Makes what speaks HTTP with a connection.
        tls: How they are encrypted.
        local: Whether it is a Unix socket.
        reception: Decides about requests by their heads, before the speaker sees them.
    """

    def __init__(
        self,
        limits: Limits,
        speaker: Callable[[Connection], asyncio.Protocol],
        tls: ssl.SSLContext | None,
        *,
        local: bool = False,
        reception: Reception | None = None,
    ) -> None:
        self.limits = limits
        self.speaker = speaker
        self.tls = tls
        self.local = local
        self.reception = reception
        self.waiting: Room[Connection] = Room(limits.waiting)
        self.answering: Room[Connection] = Room(limits.answering)
        self.streams: Room[Connection] = Room(limits.streams, limits.streams_of_one)
        self.leaving: Room[Connection] = Room(limits.leaving)
        self.lines: Room[Connection] = Room(limits.lines, limits.lines_of_one)

    @property
    def connections(self) -> int:
        """How many connections there are."""
        return sum(map(len, self._rooms))

    @property
    def _rooms(self) -> tuple[Room[Connection], ...]:
        return self.waiting, self.answering, self.streams, self.leaving, self.lines

    def move(self, connection: Connection, to: Room[Connection], owner: str) -> None:
        """Move a connection to where it is now; another one may have to go for it."""
        self.leave(connection)
        gone = to.add(connection, owner)
        if gone is not None:
            gone.abort()

    def leave(self, connection: Connection) -> None:
        """Forget a connection that has ended."""
        for room in self._rooms:
            if room.remove(connection):
                return

    def dismiss_waiting(self) -> None:
        """End those whose request is not whole."""
        for connection in self.waiting:
            connection.abort()

    def shut_down(self) -> None:
        """Tell those who are left that it is over."""
        for connection in (*self.answering, *self.streams, *self.lines):
            connection.shut_down()

    def abort(self) -> None:
        """End all at once."""
        for room in self._rooms:
            for connection in room:
                connection.abort()
