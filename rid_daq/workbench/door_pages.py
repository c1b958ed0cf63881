"""The way in: the first page, the link from the terminal, and the pairing of a new device."""

from __future__ import annotations

from http import HTTPStatus

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse
from starlette.responses import Response
from starlette.routing import Match
from starlette.types import Scope

from rid_daq.service.api.context import Door, Service, is_local
from rid_daq.workbench.visit import PageRoute, bare_page, door_page, problem_page

router = APIRouter(route_class=PageRoute, include_in_schema=False)


class _UnknownRoute(PageRoute):
    """Every address that a browser goes to, but those of programs."""

    def matches(self, scope: Scope) -> tuple[Match, Scope]:
        """Return whether a browser wants a page."""
        headers = dict(scope.get("headers", ()))
        if scope["path"].startswith("/api/") or b"text/html" not in headers.get(b"accept", b""):
            return Match.NONE, {}
        return super().matches(scope)


unknown = APIRouter(route_class=_UnknownRoute, include_in_schema=False)


@router.get("/")
async def first_page(
    request: Request, door: Door, service: Service, t: str | None = None
) -> Response:
    """Lead to the first cell; the link from the terminal lets its browser in."""
    agent = request.headers.get("user-agent", "")
    if t is not None and not door.secure:
        return door_page(door.log_in(t, agent))
    if t is not None:
        answer = RedirectResponse("/", HTTPStatus.SEE_OTHER)
        if door.look(request.headers, local=is_local(request)) is None:
            answer.headers["set-cookie"] = door.cookie(door.log_in(t, agent))
        return answer
    door.identity(request.headers, local=is_local(request))
    return RedirectResponse(f"/cells/{next(iter(service.cells))}", HTTPStatus.SEE_OTHER)


@router.get("/pair")
async def pair(request: Request, door: Door) -> Response:
    """Show the code of a new device; one that is known already is led on."""
    if door.look(request.headers, local=is_local(request)) is not None:
        return RedirectResponse("/", HTTPStatus.SEE_OTHER)
    return bare_page("pair.html")


@unknown.get("/{path:path}")
async def unknown_address(path: str) -> Response:
    """Show that there is no such page."""
    message = f"There is no page /{path}. Check the address, or begin at the cell."
    return problem_page(HTTPStatus.NOT_FOUND, message)
