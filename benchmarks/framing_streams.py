"""Byte streams for a service: HTTP requests and WebSocket frames, some of which are mutated."""

from __future__ import annotations

import random
import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

MOST_BYTES: Final = 200_000
_METHODS: Final = ("GET", "POST", "PUT", "DELETE", "HEAD", "OPTIONS", "PATCH", "TRACE", "G\0T", "")
_PATHS: Final = (
    "/api/v1/health",
    "/api/v1/cells",
    "/api/v1/cells/ir361/jobs",
    "/api/v1/cells/none/stop",
    "/api/v1/pairing/state",
    "/api/v1/files/a.json",
    "/api/v1/ws",
    "/api/v1/stop-line",
    "/%00%ff/../..//",
    "http://elsewhere.example/",
    "*",
)
_ODD_LINES: Final = (
    b"Transfer-Encoding: chunked",
    b"Transfer-Encoding: gzip, chunked",
    b"Content-Length: 5",
    b"Content-Length: -1",
    b"Content-Length: 99999999999999999999",
    b"Content-Length: 5\r\nContent-Length: 6",
    b"Expect: 100-continue",
    b"Connection: keep-alive, Upgrade",
    b"Upgrade: h2c",
    b"Content-Encoding: gzip",
    b"X-Long: " + b"y" * 20_000,
    b"\xff\xfe: \x00",
    b"No colon at all",
    b" folded",
    b"Host: elsewhere.example",
    b"Cookie: " + b"a=b; " * 2000,
    b"Range: bytes=" + b"0-1," * 3000,
)
_WEBSOCKET: Final = (
    b"Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ=="
)


@dataclass(frozen=True)
class Streams:
    """Generator of streams.

    Args:
        random: Random generator; the same seed gives the same streams.
        port: Port of the service, for the header Host.
        token: Secret of a viewer's token, which some streams contain.
    """

    random: random.Random
    port: int
    token: str

    def stream(self) -> bytes:
        """Return the bytes of one connection."""
        made = self.random.choice((self._request, self._encode_chunks, self._frames, self._noise))()
        return self._mutate(made)[:MOST_BYTES]

    def _head(self, method: str, path: str, *more: bytes) -> bytes:
        lines = [f"{method} {path} HTTP/1.{self.random.choice('0119')}".encode()]
        lines.append(f"Host: 127.0.0.1:{self.port}".encode())
        if self.random.random() < 0.7:
            lines.append(b"X-Rid-Daq: 1\r\nContent-Type: application/json")
        if self.random.random() < 0.6:
            lines.append(f"Authorization: Bearer {self.token}".encode())
        return b"\r\n".join([*lines, *more, b"", b""])

    def _request(self) -> bytes:
        choice = self.random.choice
        more = self.random.sample(_ODD_LINES, self.random.randrange(4))
        made = self._head(choice(_METHODS), choice(_PATHS), *more)
        return (made + self._bytes(2000)) * self.random.choice((1, 1, 1, 5))

    def _encode_chunks(self) -> bytes:
        made = self._head("POST", self.random.choice(_PATHS), b"Transfer-Encoding: chunked")
        for _ in range(self.random.randrange(200)):
            data = self._bytes(20)
            size = self.random.choice((len(data), len(data), len(data), 2**63, -1))
            made += f"{size:x}\r\n".encode() + data + b"\r\n"
        return made + self.random.choice((b"0\r\n\r\n", b"", b"0\r\nX: y\r\n\r\n"))

    def _frames(self) -> bytes:
        path = self.random.choice(("/api/v1/ws", "/api/v1/stop-line"))
        made = self._head("GET", path, _WEBSOCKET)
        return made + b"".join(self._frame() for _ in range(self.random.randrange(100)))

    def _frame(self) -> bytes:
        choice = self.random.choice
        payload = choice((self._bytes(200), b'{"job": "1"}', b"[" * 500, b'{"number": 1}'))
        first = self.random.randrange(256) if self.random.random() < 0.3 else choice((0x81, 0x89))
        length = choice((len(payload), len(payload), len(payload), 126, 127))
        if length < 126:
            size = bytes((0x80 | length,))
        elif length == 126:
            size = b"\xfe" + struct.pack(">H", choice((len(payload), 65535)))
        else:
            size = b"\xff" + struct.pack(">Q", choice((len(payload), 2**63 - 1, 2**64 - 1)))
        mask = self.random.randbytes(4)
        return bytes((first,)) + size + mask + bytes(b ^ mask[i % 4] for i, b in enumerate(payload))

    def _noise(self) -> bytes:
        return self._bytes(5000)

    def _bytes(self, most: int) -> bytes:
        return self.random.randbytes(self.random.randrange(most))

    def _mutate(self, made: bytes) -> bytes:
        """Return a stream with up to four random changes."""
        found = bytearray(made)
        accidents: tuple[Callable[[bytearray], None], ...] = (
            self._flip,
            self._cut,
            self._repeat,
            self._insert,
        )
        for _ in range(self.random.randrange(5)):
            if found:
                self.random.choice(accidents)(found)
        return bytes(found)

    def _flip(self, found: bytearray) -> None:
        found[self.random.randrange(len(found))] = self.random.randrange(256)

    def _cut(self, found: bytearray) -> None:
        begin = self.random.randrange(len(found))
        del found[begin : begin + self.random.randrange(1, 100)]

    def _repeat(self, found: bytearray) -> None:
        begin = self.random.randrange(len(found))
        part = found[begin : begin + self.random.randrange(1, 300)]
        found[begin:begin] = part * self.random.randrange(1, 20)

    def _insert(self, found: bytearray) -> None:
        begin = self.random.randrange(len(found))
        found[begin:begin] = self._bytes(50)
