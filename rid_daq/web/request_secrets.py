"""The secrets that a request shows: as bearer, in the protocol of a WebSocket, in cookies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

SOCKET_PROTOCOL: Final = "rid-daq"
"""A WebSocket's protocol; `rid-daq.SECRET` beside it shows a session secret."""


def bearer_of(headers: Mapping[str, str]) -> str:
    """Return the bearer token of a request, empty if it has none."""
    kind, _, token = headers.get("authorization", "").partition(" ")
    return token.strip() if kind.lower() == "bearer" else ""


def socket_secret_of(headers: Mapping[str, str]) -> str:
    """Return the secret in a WebSocket's protocols, the only header that a page chooses."""
    offered = (
        each.strip().partition(".") for each in _split(headers, "sec-websocket-protocol", ",")
    )
    return next((secret for name, _, secret in offered if name == SOCKET_PROTOCOL and secret), "")


def cookies_of(headers: Mapping[str, str]) -> Sequence[tuple[str, str]]:
    """Return the cookies of a request with their names; a name can occur twice."""
    pairs = (each.partition("=") for each in _split(headers, "cookie", ";"))
    return [(name.strip(), value.strip()) for name, _, value in pairs]


def secrets_of(headers: Mapping[str, str]) -> Sequence[str]:
    """Return every secret that a request may show, in cookies of any name: enough to stop by."""
    shown = [bearer_of(headers), socket_secret_of(headers)]
    return [each for each in (*shown, *(value for _, value in cookies_of(headers))) if each]


def _split(headers: Mapping[str, str], name: str, separator: str) -> Sequence[str]:
    return headers.get(name, "").split(separator)
