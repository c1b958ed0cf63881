"""`Connection`: one client connection, from its first byte to its end."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import ssl
import time
from http import HTTPStatus
from typing import Final, cast

from rid_daq.web.connection_groups import ConnectionGroups
from rid_daq.web.head_handler import Admitted, OpenConnection, Peer, Reply
from rid_daq.web.request_head import RequestHead

_END_OF_HEAD = b"\r\n\r\n"
_LINGER_S: Final = 1.0
_LINGER_BYTES: Final = 256 << 10
_PATIENT_S: Final = 20.0
_PATIENT_BYTES: Final = 32 << 20
_FRAMING_BYTES: Final = 8 << 10
_PIECE_BYTES: Final = 4096  # limit of one read, so that many small frames do not block the loop
_USER_TIMEOUT_MS: Final = 10_000
_STREAM_BUFFER_BYTES = 32 << 10  # limit of unsent data for a slow viewer


class Connection(asyncio.Protocol):
    """Protocol of one connection. It forwards data once the head of the request is complete.

    The speaker is the protocol to which this protocol forwards the data: HTTP, WebSocket or STOP.

    Args:
        groups: Connections of the listener.
        peer: The client, if another process has accepted the connection (default: from the socket).
        received: Bytes that this other process has already read.

    Attributes:
        owner: Owner whose limit includes this connection.
        body_bytes: Maximum size of the request's body.
    """

    def __init__(
        self, groups: ConnectionGroups, peer: Peer | None = None, received: bytes = b""
    ) -> None:
        self._groups = groups
        self._limits = groups.limits
        self._received = bytearray(received)
        self._peer = Peer(groups.local, "") if peer is None else peer
        self._known = peer is not None
        self._line: asyncio.Transport | None = None  # transport of the socket
        self._transport: asyncio.Transport | None = None  # `_line`, or its decrypted side with TLS
        self._speaker: asyncio.Protocol | None = None
        self._deadline: asyncio.TimerHandle | None = None
        self._handshake: asyncio.Task[None] | None = None
        self._patience_s = groups.limits.answer_s
        self._answered = False
        self._lost = False
        self._came_bytes = 0
        self._linger_s, self._linger_bytes = _LINGER_S, _LINGER_BYTES
        self._most_bytes = 0
        self._left = float(groups.limits.stream_bytes)
        self._left_at_s = time.monotonic()
        self.owner = ""
        self.body_bytes = groups.limits.body_bytes

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Keep the transport of the socket and start TLS if it is used."""
        self._line = cast(asyncio.Transport, transport)
        self._line.max_size = _PIECE_BYTES  # type: ignore[attr-defined]
        self._set_deadline(self._limits.request_s)
        if not (self._known or self._groups.local):
            name = self._line.get_extra_info("peername")
            self._peer = Peer(False, "" if name is None else str(name[0]))
        self.owner = self._peer.address
        self._groups.move(self, self._groups.waiting, self.owner)
        if self._groups.tls is None:
            self._transport = self._line
            if self._received:
                self._find_head(0)
        else:
            self._line.pause_reading()
            self._handshake = asyncio.get_running_loop().create_task(
                self._encrypt(self._groups.tls)
            )

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
        if self._transport is None:  # the connection was lost during the handshake
            self._clean_up()
        else:
            self._find_head(0)

    def connection_lost(self, exc: Exception | None) -> None:
        """Clean up, and tell the speaker."""
        self._clean_up()
        if self._speaker is not None:
            self._speaker.connection_lost(exc)

    def _clean_up(self) -> None:
        self._lost = True
        self._set_deadline(None)
        self._groups.leave(self)
        self._received.clear()
        if self._line is not None:
            self._line.abort()

    def data_received(self, data: bytes) -> None:
        """Collect the bytes of the head; forward all bytes after it."""
        self._came_bytes += len(data)
        if self._speaker is not None:
            if self._is_within_bounds(len(data)):
                self._forward(data)
            else:
                self.abort()
        elif self._answered:
            if self._came_bytes > self._linger_bytes:
                self.abort()
        elif not self._lost:
            before = len(self._received)
            self._received += data
            self._find_head(before)

    def _is_within_bounds(self, new: int) -> bool:
        """Return True if a client does not exceed its data limit, including framing."""
        if self not in self._groups.streams and self not in self._groups.lines:
            return self._came_bytes <= self._most_bytes
        now_s = time.monotonic()
        come = self._limits.stream_bytes_s * (now_s - self._left_at_s)
        self._left = min(float(self._limits.stream_bytes), self._left + come) - new
        self._left_at_s = now_s
        return self._left >= 0.0

    def eof_received(self) -> bool | None:
        """Forward the end of the client's data to the speaker."""
        return None if self._speaker is None else self._speaker.eof_received()

    def _find_head(self, seen: int) -> None:
        if self._transport is None or self._lost:
            return
        most = self._limits.head_bytes
        begin = max(0, seen + 1 - len(_END_OF_HEAD))
        end = self._received.find(_END_OF_HEAD, begin, most + len(_END_OF_HEAD))
        if end >= 0:
            self._process_head(end)
        elif len(self._received) > most:
            self._refuse(HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE)

    def _process_head(self, end: int) -> None:
        """Answer the request from its head, or give the connection to a speaker."""
        assert self._transport is not None
        head_handler = self._groups.head_handler
        head = None if head_handler is None else RequestHead.parse(bytes(self._received[:end]))
        decided = (
            None if head_handler is None or head is None else head_handler.receive(head, self._peer)
        )
        left = len(self._received) - end - len(_END_OF_HEAD)
        match decided:
            case Reply():
                if decided.patient:
                    self._linger_s, self._linger_bytes = _PATIENT_S, _PATIENT_BYTES
                self._reply(decided.bytes(), whole=head is not None and head.body_bytes == left)
                return
            case OpenConnection():
                self._speaker = decided.speaker()
                self._become_stop_line(decided.owner)
            case Admitted():
                self._speaker = self._groups.speaker(self)
                self.owner, self.body_bytes = decided.owner, decided.body_bytes
                self._groups.move(self, self._groups.waiting, self.owner)
                if decided.body_s is not None:
                    self._set_deadline(decided.body_s)
            case None:
                self._speaker = self._groups.speaker(self)
        self._most_bytes = self.body_bytes + self.body_bytes // 8 + _FRAMING_BYTES
        self._came_bytes = left
        self._speaker.connection_made(self._transport)
        data, self._received = bytes(self._received), bytearray()
        self._forward(data)

    def _become_stop_line(self, owner: str) -> None:
        assert self._transport is not None
        self._set_deadline(None)
        self._groups.move(self, self._groups.lines, owner)
        self._transport.set_write_buffer_limits(high=_STREAM_BUFFER_BYTES)
        line = self._transport.get_extra_info("socket")
        with contextlib.suppress(OSError):  # a Unix socket has no such option
            line.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _USER_TIMEOUT_MS)

    def _reply(self, answer: bytes, *, whole: bool) -> None:
        """Send an answer and close; read and discard the client's remaining data for a while.

        Closing earlier would discard the answer before the client receives it.
        """
        assert self._transport is not None
        self._answered = True
        self._received.clear()
        self._groups.move(self, self._groups.leaving, self.owner)
        self._set_deadline(self._linger_s)
        self._transport.write(answer)
        if whole:
            self._transport.close()
        elif self._transport.can_write_eof():
            try:
                self._transport.write_eof()
            except OSError:  # the client has closed the connection
                self.abort()

    def _forward(self, data: bytes) -> None:
        assert self._speaker is not None
        assert self._transport is not None
        self._speaker.data_received(data)
        taken_over = self._transport.get_protocol()
        if taken_over is not self:  # the HTTP protocol has created a WebSocket protocol
            self._speaker = cast(asyncio.Protocol, taken_over)
            self._transport.set_protocol(self)

    def pause_writing(self) -> None:
        """Pause the speaker and set a deadline, because the client does not receive its data."""
        if self._speaker is not None:
            self._speaker.pause_writing()
            if not self._answered:
                self._set_deadline(self._patience_s)

    def resume_writing(self) -> None:
        """Resume the speaker and cancel the deadline."""
        if self._speaker is not None:
            self._speaker.resume_writing()
            if not self._answered:
                self._set_deadline(None)

    def note_request_complete(self) -> None:
        """Record that the request is complete; there is no deadline for the answer."""
        if not self._lost:
            self._set_deadline(None)
            self._groups.move(self, self._groups.answering, self.owner)

    def become_stream(self) -> bool:
        """Record that the answer is a stream; return False if no more streams are allowed."""
        if self._lost:
            return True
        if not self._groups.streams.has_place(self.owner):
            return False
        self._groups.move(self, self._groups.streams, self.owner)
        assert self._transport is not None
        self._patience_s = self._limits.stream_s
        self._transport.set_write_buffer_limits(high=_STREAM_BUFFER_BYTES)
        line = self._transport.get_extra_info("socket")
        with contextlib.suppress(OSError):
            line.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _STREAM_BUFFER_BYTES)
        return True

    def note_answered(self) -> None:
        """Record that the answer is complete, and set the deadline for the client to receive it."""
        if not self._lost and not self._answered:
            self._answered = True
            self._set_deadline(self._limits.answer_s)

    @property
    def peer(self) -> Peer:
        """The client."""
        return self._peer

    def shut_down(self) -> None:
        """Tell the client that the server ends."""
        shutdown = getattr(self._speaker, "shutdown", None)
        if shutdown is not None:
            shutdown()

    def abort(self) -> None:
        """Close the connection at once."""
        if self._line is not None:
            self._line.abort()

    def _refuse(self, status: HTTPStatus) -> None:
        head = f"HTTP/1.1 {status.value} {status.phrase}\r\nConnection: close\r\n"
        self._reply(f"{head}Content-Length: 0\r\n\r\n".encode(), whole=False)

    def _set_deadline(self, patience_s: float | None) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None
        if patience_s is not None:
            loop = asyncio.get_running_loop()
            self._deadline = loop.call_later(patience_s, self.abort)
