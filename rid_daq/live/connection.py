"""`Connection`, `Door`, `Limits`: who may hold a connection, how long, and who goes for whom."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import ssl
from collections import Counter, OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from http import HTTPStatus
from typing import Final, cast

from rid_daq.live.reception import Line, Peer, Reception, Reply
from rid_daq.live.request_head import RequestHead

_END_OF_HEAD = b"\r\n\r\n"
_LINGER_S: Final = 1.0
_USER_TIMEOUT_MS: Final = 10_000
_STREAM_BUFFER_BYTES = 32 << 10  # what a viewer who does not keep up may be behind by


@dataclass(frozen=True)
class Limits:
    """What clients may take, at each listener.

    Attributes
    ----------
    waiting : int
        Connections whose request is not whole yet, TLS handshakes among them; the oldest goes for
        a new one.
    answering : int
        Connections that are being answered; the oldest goes for a new one.
    streams : int
        WebSockets and streams of events; no more are let in.
    leaving : int
        Connections whose answer is given but not yet taken; the oldest goes for a new one.
    lines, lines_of_one : int
        Lines of the reception (STOP), of all and of one key; the oldest of a key goes for a new
        one of it, and the oldest of the key with the most where there is no room for all.
    head_bytes, body_bytes : int
        Of a request.
    message_bytes : int
        Of a WebSocket's message.
    request_s : float
        From the connection to the request's last byte [s].
    answer_s, stream_s : float
        How long a client may take nothing of what is there for it [s].
    """

    waiting: int = 128
    answering: int = 32
    streams: int = 32
    leaving: int = 256
    lines: int = 256
    lines_of_one: int = 16
    head_bytes: int = 16 << 10
    body_bytes: int = 1 << 20
    message_bytes: int = 64 << 10
    request_s: float = 2.0
    answer_s: float = 5.0
    stream_s: float = 10.0


class Door:
    """A listener's connections, by what they are at.

    Parameters
    ----------
    limits : Limits
        How many there may be.
    speaker : callable
        Makes what speaks HTTP with a connection.
    tls : ssl.SSLContext or None
        How they are encrypted.
    local : bool
        Whether it is a Unix socket.
    reception : Reception or None
        Decides about requests by their heads, before the speaker sees them.
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
        self.waiting: OrderedDict[Connection, None] = OrderedDict()
        self.answering: OrderedDict[Connection, None] = OrderedDict()
        self.streams: OrderedDict[Connection, None] = OrderedDict()
        self.leaving: OrderedDict[Connection, None] = OrderedDict()
        self.lines: OrderedDict[Connection, str] = OrderedDict()

    @property
    def connections(self) -> int:
        """How many connections there are."""
        return sum(map(len, self._rooms))

    @property
    def _rooms(self) -> tuple[OrderedDict[Connection, None] | OrderedDict[Connection, str], ...]:
        return self.waiting, self.answering, self.streams, self.leaving, self.lines

    def enter(self, connection: Connection) -> None:
        """Let a new connection in, for the oldest where there is no room."""
        self.waiting[connection] = None
        if len(self.waiting) > self.limits.waiting:
            self.waiting.popitem(last=False)[0].abort()

    def answer(self, connection: Connection) -> None:
        """Move a connection whose request is whole, for the oldest where there is no room."""
        if connection in self.waiting:
            del self.waiting[connection]
            self.answering[connection] = None
        if len(self.answering) > self.limits.answering:
            self.answering.popitem(last=False)[0].abort()

    def stream(self, connection: Connection) -> bool:
        """Move a connection that stays; False where there is no room."""
        if len(self.streams) >= self.limits.streams:
            return False
        if connection in self.answering:
            del self.answering[connection]
            self.streams[connection] = None
        return True

    def line(self, connection: Connection, key: str) -> None:
        """Move a connection that stays as a line; each key has a few, whatever others hold."""
        self.waiting.pop(connection, None)
        self.lines[connection] = key
        held = Counter(self.lines.values())
        if held[key] > self.limits.lines_of_one:
            self._end_oldest_line(key)
        elif len(self.lines) > self.limits.lines:
            self._end_oldest_line(held.most_common(1)[0][0])

    def _end_oldest_line(self, key: str) -> None:
        oldest = next(each for each, of in self.lines.items() if of == key)
        del self.lines[oldest]
        oldest.abort()

    def take_leave(self, connection: Connection) -> None:
        """Move a connection that has its answer, for the oldest where there is no room."""
        self.waiting.pop(connection, None)
        self.leaving[connection] = None
        if len(self.leaving) > self.limits.leaving:
            self.leaving.popitem(last=False)[0].abort()

    def leave(self, connection: Connection) -> None:
        """Forget a connection that has ended."""
        for room in self._rooms:
            room.pop(connection, None)

    def dismiss_waiting(self) -> None:
        """End those whose request is not whole."""
        for connection in tuple(self.waiting):
            connection.abort()

    def shut_down(self) -> None:
        """Tell those who are left that it is over."""
        for connection in (*self.answering, *self.streams, *self.lines):
            connection.shut_down()

    def abort(self) -> None:
        """End all at once."""
        for room in self._rooms:
            for connection in tuple(room):
                connection.abort()


class Connection(asyncio.Protocol):
    """One connection: what a client sends reaches the speaker once the request's head is whole."""

    def __init__(self, door: Door) -> None:
        self._door = door
        self._limits = door.limits
        self._received = bytearray()
        self._line: asyncio.Transport | None = None  # to the socket
        self._transport: asyncio.Transport | None = None  # the same, or the one inside TLS
        self._speaker: asyncio.Protocol | None = None
        self._deadline: asyncio.TimerHandle | None = None
        self._handshake: asyncio.Task[None] | None = None
        self._patience_s = door.limits.answer_s
        self._answered = False
        self._lost = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin with a socket's connection; TLS follows."""
        self._line = cast(asyncio.Transport, transport)
        self._limit(self._limits.request_s)
        self._door.enter(self)
        if self._door.tls is None:
            self._transport = self._line
        else:
            self._line.pause_reading()
            self._handshake = asyncio.get_running_loop().create_task(self._encrypt(self._door.tls))

    async def _encrypt(self, tls: ssl.SSLContext) -> None:
        assert self._line is not None
        patience_s = self._limits.request_s
        try:
            self._transport = await asyncio.get_running_loop().start_tls(
                self._line,
                self,
                tls,
                server_side=True,
                ssl_handshake_timeout=patience_s,
                ssl_shutdown_timeout=patience_s,
            )
        except (OSError, asyncio.CancelledError):  # ssl.SSLError and TimeoutError are OSErrors
            self._transport = None
        if self._transport is None:  # it was lost in the handshake
            self._end()
        else:
            self._look_at_head(0)

    def connection_lost(self, exc: Exception | None) -> None:
        """End."""
        self._end()
        if self._speaker is not None:
            self._speaker.connection_lost(exc)

    def _end(self) -> None:
        self._lost = True
        self._limit(None)
        self._door.leave(self)
        self._received.clear()
        if self._line is not None:
            self._line.abort()

    def data_received(self, data: bytes) -> None:
        """Keep what belongs to a head, pass on what follows."""
        if self._speaker is None:
            if self._lost or self._answered:
                return
            before = len(self._received)
            self._received += data
            self._look_at_head(before)
        else:
            self._pass_on(data)

    def eof_received(self) -> bool | None:
        """Let the speaker decide."""
        return None if self._speaker is None else self._speaker.eof_received()

    def _look_at_head(self, seen: int) -> None:
        if self._transport is None or self._lost:
            return
        most = self._limits.head_bytes
        begin = max(0, seen + 1 - len(_END_OF_HEAD))
        end = self._received.find(_END_OF_HEAD, begin, most + len(_END_OF_HEAD))
        if end >= 0:
            self._receive(end)
        elif len(self._received) > most:
            self._refuse(HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE)

    def _receive(self, end: int) -> None:
        """Have the request answered from its head, taken over, or passed on to the speaker."""
        assert self._transport is not None
        head = (
            None if self._door.reception is None else RequestHead.parse(bytes(self._received[:end]))
        )
        decided = None
        if head is not None and self._door.reception is not None:
            decided = self._door.reception.receive(head, self._peer)
        if isinstance(decided, Reply):
            left = len(self._received) - end - len(_END_OF_HEAD)
            self._reply(decided.bytes(), whole=head is not None and head.body_bytes == left)
            return
        if isinstance(decided, Line):
            self._speaker = decided.speaker()
            self._become_line(decided.key)
        else:
            self._speaker = self._door.speaker(self)
        self._speaker.connection_made(self._transport)
        data, self._received = bytes(self._received), bytearray()
        self._pass_on(data)

    @property
    def _peer(self) -> Peer:
        assert self._transport is not None
        name = None if self._door.local else self._transport.get_extra_info("peername")
        return Peer(self._door.local, "" if name is None else str(name[0]))

    def _become_line(self, key: str) -> None:
        assert self._transport is not None
        self._limit(None)
        self._door.line(self, key)
        self._transport.set_write_buffer_limits(high=_STREAM_BUFFER_BYTES)
        line = self._transport.get_extra_info("socket")
        with contextlib.suppress(OSError):  # a Unix socket has no such option
            line.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _USER_TIMEOUT_MS)

    def _reply(self, answer: bytes, *, whole: bool) -> None:
        """Answer and close; what a client still sends is read for a while and thrown away.

        Closing before that would discard the answer on its way.
        """
        assert self._transport is not None
        self._answered = True
        self._received.clear()
        self._door.take_leave(self)
        self._limit(_LINGER_S)
        self._transport.write(answer)
        if whole:
            self._transport.close()
        elif self._transport.can_write_eof():
            self._transport.write_eof()

    def _pass_on(self, data: bytes) -> None:
        assert self._speaker is not None
        assert self._transport is not None
        self._speaker.data_received(data)
        taken_over = self._transport.get_protocol()
        if taken_over is not self:  # by a speaker of WebSocket
            self._speaker = cast(asyncio.Protocol, taken_over)
            self._transport.set_protocol(self)

    def pause_writing(self) -> None:
        """Wait for the client to take what is there for it, for a while."""
        if self._speaker is not None:
            self._speaker.pause_writing()
            if not self._answered:
                self._limit(self._patience_s)

    def resume_writing(self) -> None:
        """Go on."""
        if self._speaker is not None:
            self._speaker.resume_writing()
            if not self._answered:
                self._limit(None)

    def request_is_whole(self) -> None:
        """Say that the client is to be answered now, however long that takes."""
        if not self._lost:
            self._limit(None)
            self._door.answer(self)

    def become_stream(self) -> bool:
        """Say that the answer has no end; False where no more such are let in."""
        if self._lost:
            return True
        if not self._door.stream(self):
            return False
        assert self._transport is not None
        self._patience_s = self._limits.stream_s
        self._transport.set_write_buffer_limits(high=_STREAM_BUFFER_BYTES)
        line = self._transport.get_extra_info("socket")
        with contextlib.suppress(OSError):
            line.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _STREAM_BUFFER_BYTES)
        return True

    def answered(self) -> None:
        """Say that the answer has been given; the client has a while to take it."""
        if not self._lost and not self._answered:
            self._answered = True
            self._limit(self._limits.answer_s)

    def shut_down(self) -> None:
        """Tell the client that it is over."""
        shutdown = getattr(self._speaker, "shutdown", None)
        if shutdown is not None:
            shutdown()

    def abort(self) -> None:
        """Close at once."""
        if self._line is not None:
            self._line.abort()

    def _refuse(self, status: HTTPStatus) -> None:
        head = f"HTTP/1.1 {status.value} {status.phrase}\r\nConnection: close\r\n"
        self._reply(f"{head}Content-Length: 0\r\n\r\n".encode(), whole=False)

    def _limit(self, patience_s: float | None) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None
        if patience_s is not None:
            loop = asyncio.get_running_loop()
            self._deadline = loop.call_later(patience_s, self.abort)
