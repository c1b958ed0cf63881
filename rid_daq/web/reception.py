"""`Reception`: decides about a request by its head alone, before the application sees it."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from dataclasses import dataclass
from http import HTTPStatus
from typing import Protocol

from rid_daq.web.request_head import RequestHead


@dataclass(frozen=True)
class Peer:
    """The client of a connection.

    Attributes:
        local: Whether it came by a Unix socket.
        address: Its IP address; empty for a Unix socket.
    """

    local: bool
    address: str


@dataclass(frozen=True)
class Reply:
    """An answer that is given at once.

    Attributes:
        document: Its body, as JSON.
        patient: Whether a long body is still read, and thrown away, so that the client sees the
            answer.
    """

    status: HTTPStatus
    document: dict[str, object]
    patient: bool = False

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
class OpenConnection:
    """A connection that stays, apart from the application's.

    Attributes:
        owner: Whose it is: everybody has a few.
        speaker: Makes the protocol that speaks with the client, the head included.
    """

    owner: str
    speaker: Callable[[], asyncio.Protocol]


@dataclass(frozen=True)
class Admitted:
    """A request that the application may see.

    Attributes:
        owner: Whose it is.
        body_bytes: How large its body may be.
        body_s: How long the body may take from now on [s]; None for the usual time.
    """

    owner: str
    body_bytes: int
    body_s: float | None = None


class Reception(Protocol):
    """What decides about requests by their heads."""

    def receive(self, head: RequestHead, peer: Peer) -> Reply | OpenConnection | Admitted | None:
        """Return the answer, the protocol that takes over, or that the application is asked.

        None passes the connection on to the door's speaker as it is.
        """
        ...
