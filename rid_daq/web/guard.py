"""`Guard`: refuses what unknown pages in the same browser can send (decision 0022)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from http import HTTPStatus

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from rid_daq.web.access import STOP_HEADER, Access

PAGE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self';"
    " base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""What a page may load: its own files."""

PLOT_POLICY = PAGE_POLICY.replace("style-src 'self'", "style-src 'self' 'unsafe-inline'").replace(
    "img-src 'self'", "img-src 'self' data: blob:"
)
"""The same for a page with a plot library that writes styles and makes pictures."""

SAFE_METHODS = ("GET", "HEAD", "OPTIONS")
_ONCE = ("host", "origin", "sec-fetch-site", "content-type", "cookie", "authorization", STOP_HEADER)


class Guard:
    """An application behind a guard who knows our own names and our own pages.

    By TCP, `Host` must be our own name and `Origin` and `Sec-Fetch-Site` ours or absent; a Unix
    socket is out of a browser's reach. What changes something must be `application/json` and have
    the header `x-rid-daq`, which no unknown page can send without asking. A WebSocket is
    refused before it is accepted. Every answer has headers that keep a browser from taking it for
    something else; a header that the application has set stays.

    Args:
        app: What answers those who may ask.
        access: Under which names.
        policy: The pages' content security policy.
    """

    def __init__(self, app: ASGIApp, access: Access, policy: str = PAGE_POLICY) -> None:
        self._app = app
        self._access = access
        self._headers = [
            (name.encode(), value.encode())
            for name, value in (
                ("content-security-policy", policy),
                ("x-content-type-options", "nosniff"),
                ("x-frame-options", "DENY"),
                ("referrer-policy", "no-referrer"),
                ("cross-origin-opener-policy", "same-origin"),
                ("cross-origin-resource-policy", "same-origin"),
                ("cache-control", "no-store"),
            )
        ]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or let the application do so."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return

        async def reply(message: Message) -> None:
            if message["type"].endswith(".response.start"):
                own = [(name.lower(), value) for name, value in message.get("headers", [])]
                names = {name for name, _ in own}
                added = [header for header in self._headers if header[0] not in names]
                message = {**message, "headers": [*own, *added]}
            await send(message)

        status = self._refusal(scope)
        if status is None:
            await self._app(scope, receive, reply)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
        else:
            length = [(b"content-length", b"0")]
            await reply({"type": "http.response.start", "status": status, "headers": length})
            await reply({"type": "http.response.body", "body": b""})

    def _refusal(self, scope: Scope) -> HTTPStatus | None:
        """Return why a request is refused, None where it is not."""
        lines = [
            (name.decode("latin-1").lower(), value.decode("latin-1"))
            for name, value in scope["headers"]
        ]
        refusal = sender_refusal(self._access, lines, local=scope["state"]["local"])
        if refusal is not None:
            return refusal
        headers = dict(lines)
        if scope["type"] == "websocket" or scope["method"] in SAFE_METHODS:
            return None
        kind = headers.get("content-type", "").partition(";")[0].strip().lower()
        if kind != "application/json":
            return HTTPStatus.UNSUPPORTED_MEDIA_TYPE
        return None if headers.get(STOP_HEADER) else HTTPStatus.FORBIDDEN


def sender_refusal(
    access: Access, lines: Sequence[tuple[str, str]], *, local: bool
) -> HTTPStatus | None:
    """Return why a request is refused by its headers alone, None if it is not.

    Args:
        access: Our own names and pages.
        lines: The headers, names in lower case.
        local: Whether it came by a Unix socket, which no browser reaches.
    """
    counts = Counter(name for name, _ in lines)
    if any(counts[name] > 1 for name in _ONCE):
        return HTTPStatus.BAD_REQUEST
    if local:
        return None
    headers = dict(lines)
    if not access.is_own_name(headers.get("host", "")):
        return HTTPStatus.MISDIRECTED_REQUEST
    return None if access.is_own_page(headers) else HTTPStatus.FORBIDDEN
