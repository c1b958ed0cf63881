"""The way in: the first page, the link from the terminal, and the pairing of a new device."""

from __future__ import annotations

from http import HTTPStatus

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse
from starlette.responses import Response

from rid_daq.service.api.context import Door, Service, is_local
from rid_daq.workbench.visit import PageRoute, bare_page, door_page

router = APIRouter(route_class=PageRoute, include_in_schema=False)


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
