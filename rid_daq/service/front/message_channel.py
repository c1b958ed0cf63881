"""`MessageChannel`: messages, some with sockets, between the service and the front process."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import socket
from collections import deque
from collections.abc import Callable
from typing import Final

_MOST_BYTES: Final = 96 << 10
_BUFFER_BYTES: Final = 1 << 20
_MOST_WAITING: Final = 512


class MessageChannel:
    """One end of the channel between service and front process; it belongs to one event loop.

    A message is a JSON document, bytes, and at most one file descriptor. Messages keep their order.

    Args:
        line: A socket of type SOCK_SEQPACKET.
    """

    def __init__(self, line: socket.socket) -> None:
        line.setblocking(False)
        for option in (socket.SO_SNDBUF, socket.SO_RCVBUF):
            line.setsockopt(socket.SOL_SOCKET, option, _BUFFER_BYTES)
        self._line = line
        self._waiting: deque[tuple[bytes, int | None]] = deque()
        self._received: Callable[[dict[str, object], bytes, int | None], None] | None = None
        self._over: Callable[[], None] = lambda: None

    def begin(
        self,
        received: Callable[[dict[str, object], bytes, int | None], None],
        over: Callable[[], None],
    ) -> None:
        """Call `received` for every message, and `over` when the other end has closed."""
        self._received, self._over = received, over
        asyncio.get_running_loop().add_reader(self._line, self._read_message)

    def send(
        self, document: dict[str, object], data: bytes = b"", descriptor: int | None = None
    ) -> bool:
        """Send a message without waiting; return False if too many messages are queued.

        The caller must close `descriptor` itself.
        """
        head = json.dumps(document).encode()
        message = len(head).to_bytes(4, "big") + head + data
        if len(self._waiting) >= _MOST_WAITING:
            return False
        if self._waiting or not self._try_send(message, descriptor):
            self._waiting.append((message, None if descriptor is None else os.dup(descriptor)))
            asyncio.get_running_loop().add_writer(self._line, self._write_queued)
        return True

    def close(self) -> None:
        """Close this end."""
        with contextlib.suppress(RuntimeError, ValueError, OSError):
            loop = asyncio.get_running_loop()
            loop.remove_reader(self._line)
            loop.remove_writer(self._line)
        for _, descriptor in self._waiting:
            if descriptor is not None:
                os.close(descriptor)
        self._waiting.clear()
        self._line.close()

    def _try_send(self, message: bytes, descriptor: int | None) -> bool:
        try:
            socket.send_fds(self._line, [message], [] if descriptor is None else [descriptor])
        except BlockingIOError:
            return False
        except OSError:  # the other end has closed: `over` is called next
            return True
        return True

    def _write_queued(self) -> None:
        while self._waiting:
            message, descriptor = self._waiting[0]
            if not self._try_send(message, descriptor):
                return
            self._waiting.popleft()
            if descriptor is not None:
                os.close(descriptor)
        asyncio.get_running_loop().remove_writer(self._line)

    def _read_message(self) -> None:
        assert self._received is not None
        try:
            message, descriptors, _, _ = socket.recv_fds(self._line, _MOST_BYTES, 1)
        except BlockingIOError:
            return
        except OSError:
            message, descriptors = b"", []
        if not message:
            self.close()
            self._over()
            return
        length = int.from_bytes(message[:4], "big")
        document = json.loads(message[4 : 4 + length])
        self._received(document, message[4 + length :], descriptors[0] if descriptors else None)
