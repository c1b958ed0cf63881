"""`HeadHandler`: decides about a request from its head, before the application receives it."""

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
    """Client of a connection.

    Attributes:
        local: True if it connected through a Unix socket.
        address: Its IP address; empty for a Unix socket.
    """

    local: bool
    address: str


@dataclass(frozen=True)
class Reply:
    """Answer that is sent at once.

    Attributes:
        document: Body of the answer, as JSON.
        patient: True to read and discard a long request body, so that the client receives the
            answer.
    """

    status: HTTPStatus
    document: dict[str, object]
    patient: bool = False

    def bytes(self) -> bytes:
        """Return the complete answer."""
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
    """Connection that stays open and is counted apart from those of the application.

    Attributes:
        owner: Owner of the connection; each owner has a limit.
        speaker: Function that creates the protocol of the connection; it also receives the head.
    """

    owner: str
    speaker: Callable[[], asyncio.Protocol]


@dataclass(frozen=True)
class Admitted:
    """Request that the application may receive.

    Attributes:
        owner: Owner of the request.
        body_bytes: Maximum size of its body.
        body_s: Time for the body from now on [s]; None for the default limit.
    """

    owner: str
    body_bytes: int
    body_s: float | None = None


class HeadHandler(Protocol):
    """Interface of a class that decides about requests from their heads."""

    def receive(self, head: RequestHead, peer: Peer) -> Reply | OpenConnection | Admitted | None:
        """Decide about a request: answer it, let another protocol take over, or admit it.

        None passes the request to the HTTP protocol; the connection's limits do not change.
        """
        ...
