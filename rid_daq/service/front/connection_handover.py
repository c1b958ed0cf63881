"""`ConnectionHandover`: gives a connection to the service once its request's head is complete."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from typing import Final, cast

from rid_daq.service.front.message_channel import MessageChannel
from rid_daq.web.connection import Connection

_BUSY: Final = (
    b"HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\nRetry-After: 1\r\n"
    b"Connection: close\r\n\r\n"
)
_BUFFER_BYTES: Final = 32 << 10
_FIRST_BYTES: Final = 32 << 10  # more than a request head, less than the channel's message limit


class ConnectionHandover(asyncio.Protocol):
    """Protocol of a connection that carries no STOP.

    Without TLS the service receives the socket itself. With TLS the front process continues to
    encrypt, and the service receives one end of a socket pair.

    Args:
        channel: Message channel to the service.
    """

    def __init__(self, connection: Connection, channel: MessageChannel) -> None:
        self._connection = connection
        self._channel = channel
        self._outer: asyncio.Transport | None = None
        self._inner: asyncio.Transport | None = None
        self._task: asyncio.Task[None] | None = None
        self._backlog = bytearray()
        self._lost = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Store the transport; `data_received` then gets the bytes that the client has sent."""
        self._outer = cast(asyncio.Transport, transport)

    def data_received(self, data: bytes) -> None:
        """Hand the connection over with the first data; forward all data after it."""
        assert self._outer is not None
        if self._inner is not None:
            self._inner.write(data)
            return
        if self._task is not None:  # these data were decrypted before reading was paused
            self._backlog += data
            return
        self._outer.pause_reading()
        if self._outer.get_extra_info("sslcontext") is None:
            line = self._outer.get_extra_info("socket")
            if self._send_to_service(data, line.fileno()):
                self._connection.abort()  # the service has its own copy of the socket
        else:
            self._connection.note_request_complete()
            self._task = asyncio.get_running_loop().create_task(self._relay_tls(data))

    async def _relay_tls(self, data: bytes) -> None:
        ours, theirs = socket.socketpair()
        with theirs:
            sent = self._send_to_service(data[:_FIRST_BYTES], theirs.fileno())
        if not sent:
            ours.close()
            return
        loop = asyncio.get_running_loop()
        inner, _ = await loop.create_connection(lambda: _ServiceSide(self), sock=ours)
        if self._lost:
            inner.abort()
            return
        self._inner = inner
        self._inner.set_write_buffer_limits(high=_BUFFER_BYTES)
        self._inner.write(data[_FIRST_BYTES:] + bytes(self._backlog))
        self._backlog.clear()
        assert self._outer is not None
        self._outer.set_write_buffer_limits(high=_BUFFER_BYTES)
        with contextlib.suppress(RuntimeError):  # the transport was closed in the meantime
            self._outer.resume_reading()

    def _send_to_service(self, data: bytes, descriptor: int) -> bool:
        peer = self._connection.peer
        sender: dict[str, object] = {"local": peer.local, "address": peer.address}
        if self._channel.send(sender, data, descriptor):
            return True
        assert self._outer is not None
        self._outer.write(_BUSY)
        self._outer.close()
        return False

    def eof_received(self) -> bool | None:
        """Close the connection: it carries one request only."""
        return None

    def connection_lost(self, exc: Exception | None) -> None:
        """Close the service's side too."""
        self._lost = True
        if self._inner is not None:
            self._inner.close()

    def pause_writing(self) -> None:
        """Stop reading from the service until the client has received the data so far."""
        if self._inner is not None:
            self._inner.pause_reading()

    def resume_writing(self) -> None:
        """Read from the service again."""
        if self._inner is not None:
            self._inner.resume_reading()

    def forward_answer(self, data: bytes) -> None:
        """Send data of the service to the client."""
        if self._outer is not None:
            self._outer.write(data)

    def finish_answer(self) -> None:
        """Close the connection once the client has received the service's whole answer."""
        self._connection.note_answered()
        if self._outer is not None:
            self._outer.close()

    def pause_client(self, held: bool) -> None:
        """Stop (or resume) reading from the client while the service is behind."""
        if self._outer is not None:
            with contextlib.suppress(RuntimeError):
                self._outer.pause_reading() if held else self._outer.resume_reading()


class _ServiceSide(asyncio.Protocol):
    """Protocol of the front process's end of the socket pair."""

    def __init__(self, outer: ConnectionHandover) -> None:
        self._outer = outer

    def data_received(self, data: bytes) -> None:
        self._outer.forward_answer(data)

    def connection_lost(self, exc: Exception | None) -> None:
        self._outer.finish_answer()

    def pause_writing(self) -> None:
        self._outer.pause_client(True)

    def resume_writing(self) -> None:
        self._outer.pause_client(False)
