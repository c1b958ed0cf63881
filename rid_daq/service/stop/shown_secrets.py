"""What a client shows to be let in, in every place where it may; enough to stop by."""

from __future__ import annotations

import ipaddress
from collections.abc import Mapping, Sequence
from typing import Final

SOCKET_PROTOCOL: Final = "rid-daq"
"""A WebSocket's protocol; `rid-daq.SECRET` beside it shows a session secret."""

STOP_NEEDS_A_TOKEN: Final = "show a token to stop from another computer; or press the stop there"
UNKNOWN_STOPPER: Final = "RID-STOP-UNKNOWN"


def shown_secrets(headers: Mapping[str, str]) -> Sequence[str]:
    """Return every secret that a request may show: as bearer, as protocol, in any cookie."""
    kind, _, bearer = headers.get("authorization", "").partition(" ")
    found = [bearer.strip()] if kind.lower() == "bearer" else []
    for each in headers.get("sec-websocket-protocol", "").split(","):
        name, _, secret = each.strip().partition(".")
        if name == SOCKET_PROTOCOL:
            found.append(secret)
    found += [each.partition("=")[2].strip() for each in headers.get("cookie", "").split(";")]
    return [secret for secret in found if secret]


def is_loopback(address: str) -> bool:
    """Return whether an IP address is one of this computer's own."""
    try:
        found = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return False
    mapped = getattr(found, "ipv4_mapped", None)
    return found.is_loopback or (mapped is not None and mapped.is_loopback)
