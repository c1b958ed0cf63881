"""`RequestHead`: head of an HTTP request, parsed before the request is accepted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from urllib.parse import unquote


@dataclass(frozen=True)
class RequestHead:
    """Method, path and headers of a request.

    Attributes:
        method: Method as sent.
        path: Path without its query, percent-decoded.
        lines: Headers in their order, names in lower case.
    """

    method: str
    path: str
    lines: Sequence[tuple[str, str]]

    @classmethod
    def parse(cls, head: bytes) -> RequestHead | None:
        """Return the head of a request, None if it is malformed.

        Args:
            head: All bytes before the empty line.
        """
        first, *rest = head.decode("latin-1").split("\r\n")
        words = first.split(" ")
        if len(words) != 3 or not words[1].startswith("/"):
            return None
        lines = []
        for line in rest:
            name, colon, value = line.partition(":")
            if not colon or name != name.strip() or not name:
                return None
            lines.append((name.lower(), value.strip()))
        return cls(words[0], unquote(words[1].partition("?")[0]), tuple(lines))

    @property
    def headers(self) -> Mapping[str, str]:
        """Headers by name; a repeated header has its last value."""
        return MappingProxyType(dict(self.lines))

    @property
    def is_websocket(self) -> bool:
        """True if the client requests a WebSocket."""
        return self.method == "GET" and self.headers.get("upgrade", "").lower() == "websocket"

    @property
    def body_bytes(self) -> int | None:
        """Announced length of the body, None if it is unknown or malformed."""
        headers = self.headers
        if "transfer-encoding" in headers:
            return None
        length = headers.get("content-length", "0")
        return int(length) if length.isascii() and length.isdigit() else None
