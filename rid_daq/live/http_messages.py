"""The few words of HTTP/1.1 that the live page speaks: strict in, the same few headers out."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from http import HTTPStatus
from urllib.parse import parse_qs, urlsplit

MOST_HEAD_BYTES = 8192
MOST_BODY_BYTES = 1024
_REQUEST_LINE = re.compile(r"(GET|HEAD|POST) (/[!-~]*) HTTP/1\.[01]")
_HEADER = re.compile(r"([A-Za-z0-9!#$%&'*+.^_`|~-]+):[ \t]*([ -~\t]*?)[ \t]*")

SECURITY_HEADERS = (
    (
        "Content-Security-Policy",
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self';"
        " img-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    ("X-Content-Type-Options", "nosniff"),
    ("X-Frame-Options", "DENY"),
    ("Referrer-Policy", "no-referrer"),
    ("Cross-Origin-Opener-Policy", "same-origin"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
    ("Cache-Control", "no-store"),
)


class BadRequestError(Exception):
    """A request that is refused before anybody looks at what it asks."""

    def __init__(self, status: HTTPStatus) -> None:
        super().__init__(status.phrase)
        self.status = status


@dataclass(frozen=True)
class Request:
    """The head of a request.

    Attributes
    ----------
    method, path : str
        GET, HEAD or POST; without the query.
    query : dict
        The last value of each name.
    headers : dict
        By lower-case name.
    body_bytes : int
        How much follows the head.
    """

    method: str
    path: str
    query: dict[str, str]
    headers: dict[str, str]
    body_bytes: int


def parse_head(head: bytes) -> Request:
    """Return what a head, up to its empty line, asks for.

    Raises
    ------
    BadRequestError
        It is not plain HTTP/1.1 of the kind that is spoken here.
    """
    lines = head.decode("latin-1").split("\r\n")
    start = _REQUEST_LINE.fullmatch(lines[0])
    if start is None:
        raise BadRequestError(HTTPStatus.BAD_REQUEST)
    headers: dict[str, str] = {}
    for line in lines[1:]:
        match = _HEADER.fullmatch(line)
        if match is None or match[1].lower() in headers:
            raise BadRequestError(HTTPStatus.BAD_REQUEST)
        headers[match[1].lower()] = match[2]
    if "transfer-encoding" in headers:
        raise BadRequestError(HTTPStatus.LENGTH_REQUIRED)
    length = headers.get("content-length", "0")
    if not re.fullmatch(r"[0-9]{1,9}", length):
        raise BadRequestError(HTTPStatus.BAD_REQUEST)
    if int(length) > MOST_BODY_BYTES:
        raise BadRequestError(HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
    target = urlsplit(start[2])
    query = {name: values[-1] for name, values in parse_qs(target.query).items()}
    return Request(start[1], target.path, query, headers, int(length))


def response(
    status: HTTPStatus,
    body: bytes = b"",
    kind: str = "text/plain; charset=utf-8",
    extra: Mapping[str, str] | None = None,
) -> bytes:
    """Return a whole response, after which the connection is closed."""
    return _head(status, kind, {"Content-Length": str(len(body)), **(extra or {})}) + body


def stream_head() -> bytes:
    """Return the head of a response that goes on as server-sent events."""
    return _head(HTTPStatus.OK, "text/event-stream; charset=utf-8", {}) + b"retry: 1000\n\n"


def _head(status: HTTPStatus, kind: str, extra: Mapping[str, str]) -> bytes:
    lines = [
        f"HTTP/1.1 {status.value} {status.phrase}",
        f"Content-Type: {kind}",
        "Connection: close",
        *(f"{name}: {value}" for name, value in (*SECURITY_HEADERS, *extra.items())),
    ]
    return ("\r\n".join(lines) + "\r\n\r\n").encode("latin-1")
