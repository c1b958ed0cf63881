"""`Guard`: refuses requests that unknown pages in the same browser send (decision 0022)."""

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
"""Content that a page may load: files of this server."""

PLOT_POLICY = PAGE_POLICY.replace("style-src 'self'", "style-src 'self' 'unsafe-inline'").replace(
    "img-src 'self'", "img-src 'self' data: blob:"
)
"""As `PAGE_POLICY`, for a page with a plot library that writes styles and creates images."""

SAFE_METHODS = ("GET", "HEAD", "OPTIONS")
_ONCE = ("host", "origin", "sec-fetch-site", "content-type", "cookie", "authorization", STOP_HEADER)


class Guard:
    """Application that checks the sender of each request before the application behind it answers.

    For TCP, `Host` must be a name of this server, and `Origin` and `Sec-Fetch-Site` must belong to
    its pages or be absent. Browsers cannot reach a Unix socket. A request that changes something
    must be `application/json` and have the header `x-rid-daq`, which an unknown page cannot send
    without a preflight request. A WebSocket is refused before it is accepted. Every HTTP answer has
    headers that prevent a browser from interpreting it as another type; headers of the application
    are kept.

    Args:
        app: The application.
        access: Names and pages of this server.
        policy: Content security policy of the pages.
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
        """Refuse a request, or pass it to the application."""
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
        """Return the status of a refusal, None if the request is allowed."""
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
    """Return the status if the headers of a request do not allow its sender, else None.

    Args:
        access: Names and pages of this server.
        lines: The headers, names in lower case.
        local: True if the request arrived through a Unix socket, which no browser reaches.
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
