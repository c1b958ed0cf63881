"""Secrets in a request: bearer token, WebSocket protocol and cookies."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from typing import Final

SOCKET_PROTOCOL: Final = "rid-daq"
"""Protocol of our WebSockets; `rid-daq.SECRET` next to it contains a session secret."""


def bearer_of(headers: Mapping[str, str]) -> str:
    """Return the bearer token of a request, empty if it has none."""
    kind, _, token = headers.get("authorization", "").partition(" ")
    return token.strip() if kind.lower() == "bearer" else ""


def socket_secret_of(headers: Mapping[str, str]) -> str:
    """Return the secret among a WebSocket's protocols, the only header that a page can set."""
    offered = (
        each.strip().partition(".")
        for each in _header_parts(headers, "sec-websocket-protocol", ",")
    )
    return next((secret for name, _, secret in offered if name == SOCKET_PROTOCOL and secret), "")


def cookies_of(headers: Mapping[str, str]) -> Sequence[tuple[str, str]]:
    """Return the names and values of a request's cookies; a name can occur twice."""
    pairs = (each.partition("=") for each in _header_parts(headers, "cookie", ";"))
    return [(name.strip(), value.strip()) for name, _, value in pairs]


def all_secrets_of(headers: Mapping[str, str]) -> Sequence[str]:
    """Return every secret in a request, in cookies of any name; each may authorise a STOP."""
    shown = [bearer_of(headers), socket_secret_of(headers)]
    return [each for each in (*shown, *(value for _, value in cookies_of(headers))) if each]


def hash_secret(secret: str) -> str:
    """Return the SHA-256 of a secret; no salt is needed, because a secret has 256 random bits."""
    return hashlib.sha256(secret.encode("utf-8", "surrogatepass")).hexdigest()


def _header_parts(headers: Mapping[str, str], name: str, separator: str) -> Sequence[str]:
    return headers.get(name, "").split(separator)
