"""`HandOver`: gives a connection to the service once its request's head is whole."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from typing import Final, cast

from rid_daq.service.front.wire import Wire
from rid_daq.web.connection import Connection

_BUSY: Final = (
    b"HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\nRetry-After: 1\r\n"
    b"Connection: close\r\n\r\n"
)
_BUFFER_BYTES: Final = 32 << 10
_FIRST_BYTES: Final = 32 << 10  # more than a head, less than a message of the wire holds


class HandOver(asyncio.Protocol):
    """The speaker of a connection that is not STOP's.

    Without TLS the service gets the socket itself. With TLS this process goes on to encrypt, and
    the service gets one end of a pair whose other end is here.

    Args:
        wire: To the service.
    """

    def __init__(self, connection: Connection, wire: Wire) -> None:
        self._connection = connection
        self._wire = wire
        self._outer: asyncio.Transport | None = None
        self._inner: asyncio.Transport | None = None
        self._task: asyncio.Task[None] | None = None
        self._backlog = bytearray()
        self._lost = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin; what the client has sent follows as data."""
        self._outer = cast(asyncio.Transport, transport)

    def data_received(self, data: bytes) -> None:
        """Hand over with the first data, pass on all that follows."""
        assert self._outer is not None
        if self._inner is not None:
            self._inner.write(data)
            return
        if self._task is not None:  # decrypted before reading was paused
            self._backlog += data
            return
        self._outer.pause_reading()
        if self._outer.get_extra_info("sslcontext") is None:
            line = self._outer.get_extra_info("socket")
            if self._send(data, line.fileno()):
                self._connection.abort()  # the service has the socket
        else:
            self._connection.request_is_whole()
            self._task = asyncio.get_running_loop().create_task(self._relay(data))

    async def _relay(self, data: bytes) -> None:
        ours, theirs = socket.socketpair()
        with theirs:
            sent = self._send(data[:_FIRST_BYTES], theirs.fileno())
        if not sent:
            ours.close()
            return
        loop = asyncio.get_running_loop()
        inner, _ = await loop.create_connection(lambda: _Inner(self), sock=ours)
        if self._lost:
            inner.abort()
            return
        self._inner = inner
        self._inner.set_write_buffer_limits(high=_BUFFER_BYTES)
        self._inner.write(data[_FIRST_BYTES:] + bytes(self._backlog))
        self._backlog.clear()
        assert self._outer is not None
        self._outer.set_write_buffer_limits(high=_BUFFER_BYTES)
        with contextlib.suppress(RuntimeError):  # it was closed meanwhile
            self._outer.resume_reading()

    def _send(self, data: bytes, descriptor: int) -> bool:
        peer = self._connection.peer
        told: dict[str, object] = {"local": peer.local, "address": peer.address}
        if self._wire.send(told, data, descriptor):
            return True
        assert self._outer is not None
        self._outer.write(_BUSY)
        self._outer.close()
        return False

    def eof_received(self) -> bool | None:
        """Close: a connection carries one request."""
        return None

    def connection_lost(self, exc: Exception | None) -> None:
        """End the service's side too."""
        self._lost = True
        if self._inner is not None:
            self._inner.close()

    def pause_writing(self) -> None:
        """Take no more from the service until the client has taken what is here."""
        if self._inner is not None:
            self._inner.pause_reading()

    def resume_writing(self) -> None:
        """Go on."""
        if self._inner is not None:
            self._inner.resume_reading()

    def answer(self, data: bytes) -> None:
        """Pass on what the service has sent."""
        if self._outer is not None:
            self._outer.write(data)

    def answered(self) -> None:
        """Close once the client has taken all; the service has no more to send."""
        self._connection.answered()
        if self._outer is not None:
            self._outer.close()

    def hold_client(self, held: bool) -> None:
        """Read no more from the client until the service has taken what is here."""
        if self._outer is not None:
            with contextlib.suppress(RuntimeError):
                self._outer.pause_reading() if held else self._outer.resume_reading()


class _Inner(asyncio.Protocol):
    """The end of the pair that is here."""

    def __init__(self, outer: HandOver) -> None:
        self._outer = outer

    def data_received(self, data: bytes) -> None:
        self._outer.answer(data)

    def connection_lost(self, exc: Exception | None) -> None:
        self._outer.answered()

    def pause_writing(self) -> None:
        self._outer.hold_client(True)

    def resume_writing(self) -> None:
        self._outer.hold_client(False)
