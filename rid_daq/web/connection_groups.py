"""`ConnectionGroups`, `Limits`: connections of one listener by state, and their limits."""

from __future__ import annotations

import asyncio
import ssl
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rid_daq.web.connection_pool import ConnectionPool
from rid_daq.web.head_handler import HeadHandler

if TYPE_CHECKING:
    from rid_daq.web.connection import Connection


@dataclass(frozen=True)
class Limits:
    """Limits of each listener.

    The owner of a connection is the token that the client sends, or else its address. If a group
    is full, the oldest connection of the owner with the most connections is closed.

    Attributes:
        waiting: Connections with an incomplete request head or TLS handshake.
        answering: Connections whose request is being answered.
        streams, streams_of_one: WebSockets and event streams, of all owners and of one owner. A
            further one receives status 503, unless another owner has more.
        leaving: Connections whose answer is complete but not yet received by the client.
        lines, lines_of_one: WebSockets for STOP, of all owners and of one owner. A further one of
            an owner replaces its oldest.
        head_bytes, body_bytes: Size of a request's head and body; the head handler may allow
            another body size.
        message_bytes: Size of a WebSocket message.
        stream_bytes, stream_bytes_s: Data that a client may send over a WebSocket at once, and per
            second.
        request_s: Time from the connection to the last byte of the request [s]; the head handler
            may allow more for large bodies.
        answer_s, stream_s: Longest time until a full send buffer has emptied [s]. `answer_s` is
            also the time to receive a complete answer.
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


class ConnectionGroups:
    """Connections of one listener, grouped by their state.

    Args:
        limits: Limits of each group.
        speaker: Function that creates the HTTP protocol of a connection.
        tls: TLS settings, None without TLS.
        local: True if the listener is a Unix socket.
        head_handler: Decides about requests from their heads, before the HTTP protocol receives
            them.
    """

    def __init__(
        self,
        limits: Limits,
        speaker: Callable[[Connection], asyncio.Protocol],
        tls: ssl.SSLContext | None,
        *,
        local: bool = False,
        head_handler: HeadHandler | None = None,
    ) -> None:
        self.limits = limits
        self.speaker = speaker
        self.tls = tls
        self.local = local
        self.head_handler = head_handler
        self.waiting: ConnectionPool[Connection] = ConnectionPool(limits.waiting)
        self.answering: ConnectionPool[Connection] = ConnectionPool(limits.answering)
        self.streams: ConnectionPool[Connection] = ConnectionPool(
            limits.streams, limits.streams_of_one
        )
        self.leaving: ConnectionPool[Connection] = ConnectionPool(limits.leaving)
        self.lines: ConnectionPool[Connection] = ConnectionPool(limits.lines, limits.lines_of_one)

    @property
    def connections(self) -> int:
        """Number of connections."""
        return sum(map(len, self._pools))

    @property
    def _pools(self) -> tuple[ConnectionPool[Connection], ...]:
        return self.waiting, self.answering, self.streams, self.leaving, self.lines

    def move(self, connection: Connection, to: ConnectionPool[Connection], owner: str) -> None:
        """Move a connection to the group of its new state; this may close another connection."""
        self.leave(connection)
        gone = to.add(connection, owner)
        if gone is not None:
            gone.abort()

    def leave(self, connection: Connection) -> None:
        """Remove a connection from its group."""
        for pool in self._pools:
            if pool.remove(connection):
                return

    def abort_incomplete(self) -> None:
        """Close the connections whose request is incomplete."""
        for connection in self.waiting:
            connection.abort()

    def shut_down(self) -> None:
        """Tell the remaining clients that the server ends."""
        for connection in (*self.answering, *self.streams, *self.lines):
            connection.shut_down()

    def abort(self) -> None:
        """Close all connections at once."""
        for pool in self._pools:
            for connection in pool:
                connection.abort()
