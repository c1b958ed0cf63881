"""`Admission`: decides from a request's head if its sender may send a body, and of which size."""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from http import HTTPStatus
from typing import Final

from rid_daq.service.authenticator import Authenticator
from rid_daq.service.records import Identity, Role
from rid_daq.service.stop.stop_endpoint import StopEndpoint
from rid_daq.web.access import Access
from rid_daq.web.guard import SAFE_METHODS, sender_refusal
from rid_daq.web.head_handler import Admitted, OpenConnection, Peer, Reply
from rid_daq.web.request_head import RequestHead

JSON_BYTES: Final = 64 << 10
SMALL_BYTES: Final = 4 << 10
"""Size limit of the body if the sender is unknown or has read-only access [bytes]."""

FILE_BYTES: Final = (16 << 20) + JSON_BYTES
FILE_S: Final = 60.0
FILES_PATH: Final = "/api/v1/files/"
OPEN_PATHS: Final = frozenset({"/api/v1/pairing", "/api/v1/pairing/state"})
"""Requests that change something and need no token."""

OPEN_BURST: Final = 30.0
OPEN_PER_S: Final = 5.0
MOST_ADDRESSES: Final = 1000


class Rate:
    """Rate limit per owner: a burst, then a number of requests per second.

    Args:
        burst, per_s: Number of requests at once, and per second afterwards.
        now_s: Monotonic clock [s].
    """

    def __init__(
        self, burst: float, per_s: float, now_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._burst, self._per_s, self._now_s = burst, per_s, now_s
        self._left: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def allows(self, owner: str) -> bool:
        """Count a request, and return True if it is allowed."""
        now_s = self._now_s()
        left, since_s = self._left.pop(owner, (self._burst, now_s))
        left = min(self._burst, left + self._per_s * (now_s - since_s))
        allowed = left >= 1.0
        self._left[owner] = (left - 1.0 if allowed else left, now_s)
        if len(self._left) > MOST_ADDRESSES:
            self._left.popitem(last=False)
        return allowed


class Admission:
    """Answers STOP, refuses bodies that the sender must not send, and names the owner of a request.

    Args:
        stop: Answers STOP requests; every request is first passed to this object.
        authenticator: Identifies the senders of requests.
        access: Names and pages of this service.
    """

    def __init__(self, stop: StopEndpoint, authenticator: Authenticator, access: Access) -> None:
        self._stop = stop
        self._authenticator = authenticator
        self._access = access
        self._open = Rate(OPEN_BURST, OPEN_PER_S)

    def receive(self, head: RequestHead, peer: Peer) -> Reply | OpenConnection | Admitted:
        """Return the decision about a request."""
        stop = self._stop.receive(head, peer)
        if stop is not None:
            return stop
        refusal = sender_refusal(self._access, head.lines, local=peer.local)
        if refusal is not None:
            return _refusal_reply(
                refusal,
                "RID-ACCESS-SENDER",
                "this request does not come from a page of this service, or names another host",
            )
        who = self._authenticator.find_identity(head.headers, local=peer.local)
        if head.method in SAFE_METHODS:
            most = 0
        elif who is not None:
            most = _most_bytes(head, who)
        elif head.path not in OPEN_PATHS:
            message = (
                "this request has no valid token: send one (Authorization: Bearer ...), or"
                " pair this device on its page"
            )
            return _refusal_reply(HTTPStatus.UNAUTHORIZED, "RID-ACCESS-UNKNOWN", message)
        elif not self._open.allows(peer.address):
            message = "too many requests from this address: wait some seconds"
            return _refusal_reply(HTTPStatus.TOO_MANY_REQUESTS, "RID-REQUEST-RATE", message)
        else:
            most = SMALL_BYTES
        if _is_too_long(head, most):
            message = f"the body of this request is too long: at most {most} bytes are allowed"
            refused = _refusal_reply(
                HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "RID-REQUEST-SIZE", message
            )
            return replace(refused, patient=who is not None)
        owner = f"address {peer.address}" if who is None else f"token {who.token}"
        return Admitted(owner, most, FILE_S if most == FILE_BYTES else None)


def _most_bytes(head: RequestHead, who: Identity) -> int:
    if not who.role.includes(Role.OPERATOR):
        return SMALL_BYTES
    is_file = head.method in ("PUT", "POST") and head.path.startswith(FILES_PATH)
    return FILE_BYTES if is_file else JSON_BYTES


def _is_too_long(head: RequestHead, most: int) -> bool:
    """Return True if the announced body is too long.

    A body of unknown length is counted when it arrives.
    """
    if "transfer-encoding" in head.headers:
        return most == 0
    return head.body_bytes is None or head.body_bytes > most


def _refusal_reply(status: HTTPStatus, code: str, message: str) -> Reply:
    return Reply(status, {"error": "Refused", "message": message, "code": code})
