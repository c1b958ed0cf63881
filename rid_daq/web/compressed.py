"""Answers in gzip: `CompressedBody` of one body, `CompressedJson` of an application's documents."""

from __future__ import annotations

import gzip
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_LEVEL: Final = 6
LARGEST_LEVEL: Final = 9
"""Level for bodies that are compressed once and sent often."""

FEWEST_BYTES: Final = 1000
"""Size from which a document is compressed: a smaller one fits in one packet."""


@dataclass(frozen=True)
class CompressedBody:
    """A body, uncompressed and in gzip.

    Attributes:
        plain: The body.
        gzipped: The body in gzip.
    """

    plain: bytes
    gzipped: bytes

    @classmethod
    def of(cls, plain: bytes, level: int = _LEVEL) -> CompressedBody:
        """Compress a body, with a level of gzip."""
        return cls(plain, gzip.compress(plain, level, mtime=0))

    def answer(
        self, request: Request, media_type: str, headers: Mapping[str, str] | None = None
    ) -> Response:
        """Return the answer to a request, in an encoding that the client accepts.

        Args:
            request: The request with its header `Accept-Encoding`.
            media_type: Media type of the body.
            headers: Other headers of the answer.
        """
        body, encoding = self.for_client(request)
        return Response(body, media_type=media_type, headers={**(headers or {}), **encoding})

    def for_client(self, request: Request) -> tuple[bytes, dict[str, str]]:
        """Return the body in an encoding that the client accepts, and the headers that name it."""
        if _accepts_gzip(request.headers):
            return self.gzipped, {"vary": "accept-encoding", "content-encoding": "gzip"}
        return self.plain, {"vary": "accept-encoding"}


class CompressedJson:
    """Application that compresses its large JSON documents, if the client accepts gzip.

    Only answers to GET requests are compressed: they contain no secrets. Files that are sent in
    parts stay as they are.

    Args:
        app: The application that makes the documents.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request to the application, and compress its answer."""
        is_get = scope["type"] == "http" and scope["method"] == "GET"
        if not is_get or not _accepts_gzip(Headers(scope=scope)):
            await self._app(scope, receive, send)
            return
        start: Message | None = None

        async def send_compressed(message: Message) -> None:
            nonlocal start
            if message["type"] == "http.response.start":
                start = message
                return
            if start is not None:
                begun, start = start, None
                message = await _compress(begun, message)
                await send(begun)
            await send(message)

        await self._app(scope, receive, send_compressed)


async def _compress(start: Message, first: Message) -> Message:
    """Change the head of an answer, and return its first part compressed, if it is a document.

    Compression runs in another thread, so that a large document does not delay other requests.
    """
    headers = MutableHeaders(raw=start["headers"])
    body: bytes = first.get("body", b"")
    is_json = headers.get("content-type", "").startswith("application/json")
    if not is_json or first.get("more_body") or "content-encoding" in headers:
        return first
    headers.add_vary_header("accept-encoding")
    if len(body) < FEWEST_BYTES:
        return first
    packed = await run_in_threadpool(gzip.compress, body, _LEVEL, mtime=0)
    headers["content-encoding"] = "gzip"
    headers["content-length"] = str(len(packed))
    return {**first, "body": packed}


def _accepts_gzip(headers: Headers) -> bool:
    accepted = headers.get("accept-encoding", "").lower().split(",")
    return "gzip" in (each.strip() for each in accepted)
