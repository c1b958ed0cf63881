"""`LiveServer`: answers browsers; bounded in connections, memory and time, whatever they do."""

from __future__ import annotations

import asyncio
import ipaddress
from collections import OrderedDict
from collections.abc import Callable
from http import HTTPStatus
from importlib.resources import files
from typing import cast

from rid_daq.live.access import STOP_HEADER, Access
from rid_daq.live.http_messages import (
    MOST_HEAD_BYTES,
    BadRequestError,
    Request,
    parse_head,
    response,
    stream_head,
)

MOST_WAITING = 128
MOST_STREAMS = 32
REQUEST_PATIENCE_S = 2.0
ANSWER_PATIENCE_S = 5.0
STREAM_PATIENCE_S = 10.0
MOST_UNSENT_BYTES = 64 << 10

_FILES = {
    "/": ("page.html", "text/html; charset=utf-8"),
    "/page.css": ("page.css", "text/css; charset=utf-8"),
    "/icon.svg": ("icon.svg", "image/svg+xml"),
    "/page.js": ("page.js", "text/javascript; charset=utf-8"),
}
_NO_TOKEN = (
    b"This page needs the whole address that rid-daq has shown in its terminal, with ?t= and what"
    b" follows.\n"
)


class LiveServer:
    """The connections, and what they get.

    A connection has `REQUEST_PATIENCE_S` for its whole request; where more than `MOST_WAITING` are
    at it, the oldest has to go, so that a new one - the stop button's - is always let in. Only
    viewers with the token hold a connection for longer, `MOST_STREAMS` of them.

    Parameters
    ----------
    access : Access
        Who may ask for what.
    stop : callable
        Asks for the motion's stop.
    """

    def __init__(self, access: Access, stop: Callable[[], None]) -> None:
        self.access = access
        self.stop = stop
        self.waiting: OrderedDict[_Connection, None] = OrderedDict()
        self.streams: set[_Connection] = set()
        self.latest = b""
        folder = files("rid_daq.live")
        self._files = {
            path: (folder.joinpath(name).read_bytes(), kind)
            for path, (name, kind) in _FILES.items()
        }

    def protocol(self) -> asyncio.Protocol:
        """Return what serves one new connection."""
        return _Connection(self)

    def publish(self, document: bytes) -> None:
        """Send a document, one line of JSON, to every viewer who has taken the one before."""
        self.latest = b"data: " + document + b"\n\n"
        for stream in tuple(self.streams):
            stream.send_event(self.latest)

    def close(self) -> None:
        """End all connections."""
        for connection in (*self.streams, *self.waiting):
            connection.finish()

    def answer(self, request: Request, peer: str) -> bytes | None:
        """Return the response to a request; None where it opens a stream of events."""
        access, headers = self.access, request.headers
        if not access.is_own_name(headers.get("host", "")):
            return response(HTTPStatus.MISDIRECTED_REQUEST)
        if not access.is_own_page(headers):
            return response(HTTPStatus.FORBIDDEN)
        if request.method == "POST":
            return self._stop(request, peer)
        if request.path == "/" and "t" in request.query:
            if not access.knows(request.query["t"]):
                return response(HTTPStatus.FORBIDDEN, _NO_TOKEN)
            away = {"Location": "/", "Set-Cookie": access.cookie()}
            return response(HTTPStatus.SEE_OTHER, extra=away)
        if not access.has_token(headers):
            return response(HTTPStatus.FORBIDDEN, _NO_TOKEN)
        if request.path == "/events" and request.method == "GET":
            if len(self.streams) >= MOST_STREAMS:
                again = {"Retry-After": "5"}
                return response(HTTPStatus.SERVICE_UNAVAILABLE, b"too many viewers\n", extra=again)
            return None
        if request.path not in self._files:
            return response(HTTPStatus.NOT_FOUND)
        body, kind = self._files[request.path]
        if request.method == "HEAD":
            return response(HTTPStatus.OK, kind=kind)
        return response(HTTPStatus.OK, body, kind)

    def _stop(self, request: Request, peer: str) -> bytes:
        """Ask for the stop; the one thing that can be changed, and from here without the token."""
        headers = request.headers
        if request.path != "/stop":
            return response(HTTPStatus.NOT_FOUND)
        kind = headers.get("content-type", "").partition(";")[0].strip().lower()
        if kind != "application/json":
            return response(HTTPStatus.UNSUPPORTED_MEDIA_TYPE)
        if headers.get(STOP_HEADER) != "stop":
            return response(HTTPStatus.FORBIDDEN)
        from_here: bool = ipaddress.ip_address(peer).is_loopback
        if not from_here and not self.access.has_token(headers):
            return response(HTTPStatus.FORBIDDEN, _NO_TOKEN)
        self.stop()
        return response(HTTPStatus.ACCEPTED, b'{"stop": "asked for"}\n', "application/json")


class _Connection(asyncio.Protocol):
    """One connection: one request, one answer; or one stream of events."""

    def __init__(self, server: LiveServer) -> None:
        self._server = server
        self._received = bytearray()
        self._request: Request | None = None
        self._transport: asyncio.Transport | None = None
        self._deadline: asyncio.TimerHandle | None = None
        self._behind_since_s: float | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        waiting = self._server.waiting
        waiting[self] = None
        if len(waiting) > MOST_WAITING:
            waiting.popitem(last=False)[0].abort()
        self._limit(REQUEST_PATIENCE_S)

    def connection_lost(self, exc: Exception | None) -> None:
        self._server.waiting.pop(self, None)
        self._server.streams.discard(self)
        if self._deadline is not None:
            self._deadline.cancel()
        self._received.clear()
        self._transport = None

    def data_received(self, data: bytes) -> None:
        if self not in self._server.waiting or self._transport is None:
            return  # answered already, or a stream: whatever else comes is not read
        self._received += data
        try:
            if self._request is None:
                head, end, rest = self._received.partition(b"\r\n\r\n")
                if not end:
                    if len(self._received) > MOST_HEAD_BYTES:
                        raise BadRequestError(HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE)
                    return
                if len(head) > MOST_HEAD_BYTES:
                    raise BadRequestError(HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE)
                self._request = parse_head(bytes(head))
                self._received = bytearray(rest)
            if len(self._received) < self._request.body_bytes:
                return
            peer = self._transport.get_extra_info("peername")[0]
            answer = self._server.answer(self._request, peer)
        except BadRequestError as error:
            answer = response(error.status)
        self._received.clear()
        if answer is None:
            self._begin_stream()
        else:
            self._send_last(answer)

    def _begin_stream(self) -> None:
        assert self._transport is not None
        if self._deadline is not None:
            self._deadline.cancel()
        self._server.waiting.pop(self, None)
        self._server.streams.add(self)
        self._transport.pause_reading()
        self._transport.write(stream_head() + self._server.latest)

    def send_event(self, event: bytes) -> None:
        """Send an event, or leave it out where the viewer does not keep up; end one who hangs."""
        transport = self._transport
        if transport is None or transport.is_closing():
            return
        now_s = asyncio.get_running_loop().time()
        if transport.get_write_buffer_size() == 0:
            self._behind_since_s = None
        elif self._behind_since_s is None:
            self._behind_since_s = now_s
        elif now_s - self._behind_since_s > STREAM_PATIENCE_S:
            self.abort()
            return
        if transport.get_write_buffer_size() < MOST_UNSENT_BYTES:
            transport.write(event)

    def finish(self) -> None:
        """Close once all is sent, or after a while."""
        if self._transport is not None:
            self._transport.close()
            self._limit(ANSWER_PATIENCE_S)

    def abort(self) -> None:
        """Close at once."""
        if self._transport is not None:
            self._transport.abort()

    def _send_last(self, answer: bytes) -> None:
        assert self._transport is not None
        self._transport.write(answer)
        self.finish()

    def _limit(self, patience_s: float) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
        self._deadline = asyncio.get_running_loop().call_later(patience_s, self.abort)
