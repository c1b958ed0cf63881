"""Client that presses STOP as a browser does, over plain sockets, which need little time.

The client represents another computer. Therefore its process has a high priority, if the system
permits it.
"""

from __future__ import annotations

import base64
import contextlib
import json
import os
import socket
import struct
import time
from collections.abc import Iterator
from typing import Final

import numpy as np

LOST_S: Final = 5.0
NICENESS: Final = -15
_FLOOR_SIZE: Final = 64


class Pressed:
    """Response times of STOP over one type of connection, and number of lost STOPs."""

    def __init__(self) -> None:
        self.took_ms: list[float] = []
        self.lost = 0

    def add(self, began_s: float, answered: bool) -> None:
        """Add one press."""
        if answered:
            self.took_ms.append(1e3 * (time.monotonic() - began_s))
        else:
            self.lost += 1

    def quantile(self, q: float) -> float:
        """Return a quantile of the response times [ms]; infinity if there is no answer."""
        return float(np.quantile(self.took_ms, q)) if self.took_ms else float("inf")

    @property
    def words(self) -> str:
        """Text with the figures."""
        p50, p99, worst = map(self.quantile, (0.5, 0.99, 1.0))
        n = len(self.took_ms) + self.lost
        return f"p50 {p50:.1f} ms, p99 {p99:.1f} ms, worst {worst:.1f} ms, {self.lost} of {n} lost"


def press_http(port: int, cell: str, pressed: Pressed) -> None:
    """Press STOP over a new connection."""
    request = (
        f"POST /api/v1/cells/{cell}/stop HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n"
        "X-Rid-Daq: stop\r\nContent-Type: application/json\r\nContent-Length: 2\r\n\r\n{}"
    ).encode()
    began_s, answer = time.monotonic(), b""
    with (
        contextlib.suppress(OSError),
        socket.create_connection(("127.0.0.1", port), timeout=LOST_S) as line,
    ):
        line.sendall(request)
        answer = line.recv(4096)
    pressed.add(began_s, b" 202 " in answer[:20])


class StopLineClient:
    """An open `/api/v1/stop-line`.

    Args:
        line: Socket after the handshake.
    """

    def __init__(self, line: socket.socket) -> None:
        self._line = line
        self._received = b""

    @classmethod
    @contextlib.contextmanager
    def at(cls, port: int) -> Iterator[StopLineClient]:
        """Open a stop line and close it at the end of the context."""
        key = base64.b64encode(os.urandom(16)).decode()
        request = (
            f"GET /api/v1/stop-line HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\n"
            f"Connection: Upgrade\r\nSec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n"
        ).encode()
        with socket.create_connection(("127.0.0.1", port), timeout=LOST_S) as line:
            line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            line.sendall(request)
            client = cls(line)
            while b"\r\n\r\n" not in client._received:
                client._received += line.recv(4096)
            head, _, client._received = client._received.partition(b"\r\n\r\n")
            if b" 101 " not in head[:20]:
                raise SystemExit(f"the service refused the WebSocket for stops: {head!r}")
            yield client

    def press(self, cell: str, number: int, pressed: Pressed) -> None:
        """Press STOP."""
        message = json.dumps({"stop": cell, "number": number}).encode()
        mask = os.urandom(4)
        masked = bytes(byte ^ mask[i % 4] for i, byte in enumerate(message))
        began_s, answered = time.monotonic(), False
        with contextlib.suppress(TimeoutError, ConnectionError):
            self._line.sendall(struct.pack("BB", 0x81, 0x80 | len(message)) + mask + masked)
            while not answered:
                message_in = json.loads(self._message())
                answered = message_in["type"] == "stopped" and message_in["number"] == number
        pressed.add(began_s, answered)

    def _message(self) -> bytes:
        while True:
            received = self._received
            if len(received) >= 2:
                length, begin = received[1] & 0x7F, 2
                if length == 126 and len(received) >= 4:
                    length, begin = int.from_bytes(received[2:4], "big"), 4
                if length != 126 and len(received) >= begin + length:
                    self._received = received[begin + length :]
                    return received[begin : begin + length]
            more = self._line.recv(4096)
            if not more:
                raise ConnectionError
            self._received += more


def echo(listener: socket.socket) -> None:
    """Echo every message at once; main function of a process."""
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, -10)  # like the process that answers STOP
    line, _ = listener.accept()
    while data := line.recv(_FLOOR_SIZE):
        line.sendall(data)


def press_echo(line: socket.socket, pressed: Pressed) -> None:
    """Measure the time for a message to a process that only echoes, and back."""
    began_s = time.monotonic()
    line.sendall(b"x" * _FLOOR_SIZE)
    pressed.add(began_s, bool(line.recv(_FLOOR_SIZE)))


def raise_priority() -> None:
    """Raise this process's priority, if the system permits it."""
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
