"""`Connection`: one client, from its first byte to its end."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import ssl
import time
from http import HTTPStatus
from typing import Final, cast

from rid_daq.web.door import Door
from rid_daq.web.reception import Admitted, OpenConnection, Peer, Reply
from rid_daq.web.request_head import RequestHead

_END_OF_HEAD = b"\r\n\r\n"
_LINGER_S: Final = 1.0
_LINGER_BYTES: Final = 256 << 10
_PATIENT_S: Final = 20.0
_PATIENT_BYTES: Final = 32 << 20
_FRAMING_BYTES: Final = 8 << 10
_PIECE_BYTES: Final = 4096  # what is read at once: many small frames must not hold the loop
_USER_TIMEOUT_MS: Final = 10_000
_STREAM_BUFFER_BYTES = 32 << 10  # what a viewer who does not keep up may be behind by


class Connection(asyncio.Protocol):
    """One connection: what a client sends reaches the speaker once the request's head is whole.

    Args:
        door: Where it came in.
        peer: The client, if another process has accepted it; else the socket tells.
        received: What that process has read already.

    Attributes:
        owner: Who is counted for it.
        body_bytes: How large its request's body may be.
    """

    def __init__(self, door: Door, peer: Peer | None = None, received: bytes = b"") -> None:
        self._door = door
        self._limits = door.limits
        self._received = bytearray(received)
        self._peer = Peer(door.local, "") if peer is None else peer
        self._known = peer is not None
        self._line: asyncio.Transport | None = None  # to the socket
        self._transport: asyncio.Transport | None = None  # the same, or the one inside TLS
        self._speaker: asyncio.Protocol | None = None
        self._deadline: asyncio.TimerHandle | None = None
        self._handshake: asyncio.Task[None] | None = None
        self._patience_s = door.limits.answer_s
        self._answered = False
        self._lost = False
        self._came_bytes = 0
        self._linger_s, self._linger_bytes = _LINGER_S, _LINGER_BYTES
        self._most_bytes = 0
        self._left = float(door.limits.stream_bytes)
        self._left_at_s = time.monotonic()
        self.owner = ""
        self.body_bytes = door.limits.body_bytes

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin with a socket's connection; TLS follows."""
        self._line = cast(asyncio.Transport, transport)
        self._line.max_size = _PIECE_BYTES  # type: ignore[attr-defined]
        self._limit(self._limits.request_s)
        if not (self._known or self._door.local):
            name = self._line.get_extra_info("peername")
            self._peer = Peer(False, "" if name is None else str(name[0]))
        self.owner = self._peer.address
        self._door.move(self, self._door.waiting, self.owner)
        if self._door.tls is None:
            self._transport = self._line
            if self._received:
                self._look_at_head(0)
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
        self._came_bytes += len(data)
        if self._speaker is not None:
            if self._is_within_bounds(len(data)):
                self._pass_on(data)
            else:
                self.abort()
        elif self._answered:
            if self._came_bytes > self._linger_bytes:
                self.abort()
        elif not self._lost:
            before = len(self._received)
            self._received += data
            self._look_at_head(before)

    def _is_within_bounds(self, new: int) -> bool:
        """Return whether a client sends no more than it may, framing included."""
        if self not in self._door.streams and self not in self._door.lines:
            return self._came_bytes <= self._most_bytes
        now_s = time.monotonic()
        come = self._limits.stream_bytes_s * (now_s - self._left_at_s)
        self._left = min(float(self._limits.stream_bytes), self._left + come) - new
        self._left_at_s = now_s
        return self._left >= 0.0

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
        reception = self._door.reception
        head = None if reception is None else RequestHead.parse(bytes(self._received[:end]))
        decided = None if reception is None or head is None else reception.receive(head, self._peer)
        left = len(self._received) - end - len(_END_OF_HEAD)
        match decided:
            case Reply():
                if decided.patient:
                    self._linger_s, self._linger_bytes = _PATIENT_S, _PATIENT_BYTES
                self._reply(decided.bytes(), whole=head is not None and head.body_bytes == left)
                return
            case OpenConnection():
                self._speaker = decided.speaker()
                self._become_line(decided.owner)
            case Admitted():
                self._speaker = self._door.speaker(self)
                self.owner, self.body_bytes = decided.owner, decided.body_bytes
                self._door.move(self, self._door.waiting, self.owner)
                if decided.body_s is not None:
                    self._limit(decided.body_s)
            case None:
                self._speaker = self._door.speaker(self)
        self._most_bytes = self.body_bytes + self.body_bytes // 8 + _FRAMING_BYTES
        self._came_bytes = left
        self._speaker.connection_made(self._transport)
        data, self._received = bytes(self._received), bytearray()
        self._pass_on(data)

    def _become_line(self, owner: str) -> None:
        assert self._transport is not None
        self._limit(None)
        self._door.move(self, self._door.lines, owner)
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
        self._door.move(self, self._door.leaving, self.owner)
        self._limit(self._linger_s)
        self._transport.write(answer)
        if whole:
            self._transport.close()
        elif self._transport.can_write_eof():
            try:
                self._transport.write_eof()
            except OSError:  # the client has gone
                self.abort()

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
            self._door.move(self, self._door.answering, self.owner)

    def become_stream(self) -> bool:
        """Say that the answer has no end; False where no more such are let in."""
        if self._lost:
            return True
        if not self._door.streams.has_place(self.owner):
            return False
        self._door.move(self, self._door.streams, self.owner)
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

    @property
    def peer(self) -> Peer:
        """The client."""
        return self._peer

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
