"""`Reception`: decides about a request by its head alone, before the application sees it."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from dataclasses import dataclass
from http import HTTPStatus
from typing import Protocol

from rid_daq.live.request_head import RequestHead


@dataclass(frozen=True)
class Peer:
    """The client of a connection.

    Attributes
    ----------
    local : bool
        Whether it came by a Unix socket.
    address : str
        Its IP address; empty for a Unix socket.
    """

    local: bool
    address: str


@dataclass(frozen=True)
class Reply:
    """An answer that is given at once.

    Attributes
    ----------
    status : HTTPStatus
        Its status.
    document : dict
        Its body, as JSON.
    """

    status: HTTPStatus
    document: dict[str, object]

    def bytes(self) -> bytes:
        """Return all of the answer."""
        body = json.dumps(self.document).encode()
        head = (
            f"HTTP/1.1 {self.status.value} {self.status.phrase}\r\n"
            "Content-Type: application/json\r\n"
            f"Content-Length: {len(body)}\r\n"
            "Cache-Control: no-store\r\n"
            "X-Content-Type-Options: nosniff\r\n"
            "Connection: close\r\n\r\n"
        )
        return head.encode() + body


@dataclass(frozen=True)
class Line:
    """A connection that stays, apart from the application's.

    Attributes
    ----------
    key : str
        Whose it is: everybody has a few.
    speaker : callable
        Makes the protocol that speaks with the client, the head included.
    """

    key: str
    speaker: Callable[[], asyncio.Protocol]


class Reception(Protocol):
    """What decides about requests by their heads."""

    def receive(self, head: RequestHead, peer: Peer) -> Reply | Line | None:
        """Return the answer, or the protocol that takes over; None to ask the application."""
