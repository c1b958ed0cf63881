"""`live_app`: application of the live page: the page, its events, and the stop request."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable
from http import HTTPStatus
from importlib.resources import files
from string import Template

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp

from rid_daq.web.access import STOP_HEADER, Access, is_loopback
from rid_daq.web.feed import Feed
from rid_daq.web.guard import Guard
from rid_daq.web.script_comments import without_comments

_FILES = {
    "/": ("page.html", "text/html"),
    "/page.css": ("page.css", "text/css"),
    "/icon.svg": ("icon.svg", "image/svg+xml"),
    "/page.js": ("page.js", "text/javascript"),
    "/stop.js": ("stop.js", "text/javascript"),
}
_NO_TOKEN = (
    "This page needs the complete address that rid-daq has printed in its terminal, including ?t="
    " and the characters after it.\n"
)


def live_app(access: Access, feed: Feed, stop: Callable[[], None]) -> ASGIApp:
    """Return the application behind its guard.

    A request for the page or its events must contain the token, or the session secret of a page
    that was opened with the token. A stop request from this computer needs neither: an unnecessary
    stop costs a recording, but a missing stop can damage the robot.

    Args:
        access: Address and secrets of the page.
        feed: Feed of the events; each event is one line of JSON.
        stop: Function that requests the stop of the motion.
    """
    folder = files("rid_daq.live")
    contents = {path: folder.joinpath(name).read_bytes() for path, (name, _) in _FILES.items()}
    for path in contents:
        if path.endswith(".js"):
            contents[path] = without_comments(contents[path].decode()).encode()
    page = Template(contents.pop("/").decode()).substitute(session=access.session).encode()

    async def main_page(request: Request) -> Response:
        token = request.query_params.get("t")
        if token is not None and access.is_token(token):
            away = {"Location": f"/?s={access.session}"}
            return Response(status_code=HTTPStatus.SEE_OTHER, headers=away)
        if token is not None or not _is_admitted(request):
            return _not_admitted()
        return Response(page, media_type="text/html")

    async def file(request: Request) -> Response:
        path = request.url.path
        if path not in contents:
            return Response(status_code=HTTPStatus.NOT_FOUND)
        return Response(contents[path], media_type=_FILES[path][1])

    async def events(request: Request) -> Response:
        if not _is_admitted(request):
            return _not_admitted()
        if request.method != "GET":  # Starlette also routes HEAD requests to this function
            return Response(status_code=HTTPStatus.NOT_FOUND)
        return StreamingResponse(_lines(feed), media_type="text/event-stream")

    async def ask_to_stop(request: Request) -> Response:
        if request.headers.get(STOP_HEADER) != "stop":
            return Response(status_code=HTTPStatus.FORBIDDEN)
        if not _from_here(request) and not _is_admitted(request):
            return _not_admitted()
        stop()
        return JSONResponse({"stop": "asked for"}, HTTPStatus.ACCEPTED)

    def _is_admitted(request: Request) -> bool:
        return access.admits(request.headers, request.query_params.get("s"))

    async def not_found(request: Request, error: Exception) -> Response:
        return Response(status_code=HTTPStatus.NOT_FOUND)

    app = Starlette(
        routes=[
            Route("/stop", ask_to_stop, methods=["POST"]),
            Route("/events", events, methods=["GET"]),
            Route("/", main_page, methods=["GET"]),
            Route("/{path:path}", file, methods=["GET"]),
        ],
        exception_handlers={HTTPStatus.METHOD_NOT_ALLOWED: not_found},
    )
    return Guard(app, access)


async def _lines(feed: Feed) -> AsyncIterator[bytes]:
    yield b"retry: 1000\n\n"
    async for document in feed.view():
        yield b"data: " + document + b"\n\n"


def _from_here(request: Request) -> bool:
    if request.state.local:
        return True
    return request.client is not None and is_loopback(request.client.host)


def _not_admitted() -> Response:
    return Response(_NO_TOKEN, HTTPStatus.FORBIDDEN, media_type="text/plain")
