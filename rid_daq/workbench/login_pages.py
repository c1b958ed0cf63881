"""Pages for access: the first page, the link from the terminal, and the pairing of a new device."""

from __future__ import annotations

from http import HTTPStatus

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse
from starlette.responses import Response
from starlette.routing import Match
from starlette.types import Scope

from rid_daq.service.api.context import Auth, Service, is_local
from rid_daq.workbench.visit import PageRoute, bare_page, login_page, problem_page

router = APIRouter(route_class=PageRoute, include_in_schema=False)


class _UnknownRoute(PageRoute):
    """Matches every address that a browser opens as a page, except those of the API."""

    def matches(self, scope: Scope) -> tuple[Match, Scope]:
        """Return a match if a browser requests a page."""
        headers = dict(scope.get("headers", ()))
        if scope["path"].startswith("/api/") or b"text/html" not in headers.get(b"accept", b""):
            return Match.NONE, {}
        return super().matches(scope)


unknown = APIRouter(route_class=_UnknownRoute, include_in_schema=False)


@router.get("/")
async def first_page(
    request: Request, authenticator: Auth, service: Service, t: str | None = None
) -> Response:
    """Redirect to the first cell; the link from the terminal logs the browser in."""
    agent = request.headers.get("user-agent", "")
    if t is not None and not authenticator.secure:
        return login_page(authenticator.log_in(t, agent))
    if t is not None:
        answer = RedirectResponse("/", HTTPStatus.SEE_OTHER)
        if authenticator.find_identity(request.headers, local=is_local(request)) is None:
            answer.headers["set-cookie"] = authenticator.cookie(authenticator.log_in(t, agent))
        return answer
    authenticator.require_identity(request.headers, local=is_local(request))
    return RedirectResponse(f"/cells/{next(iter(service.cells))}", HTTPStatus.SEE_OTHER)


@router.get("/pair")
async def pair(request: Request, authenticator: Auth) -> Response:
    """Show the pairing code of a new device; redirect a known device."""
    if authenticator.find_identity(request.headers, local=is_local(request)) is not None:
        return RedirectResponse("/", HTTPStatus.SEE_OTHER)
    return bare_page("pair.html")


@unknown.get("/{path:path}")
async def unknown_address(path: str) -> Response:
    """Show that the page does not exist."""
    message = f"There is no page /{path}. Check the address, or start at the cell's page."
    return problem_page(HTTPStatus.NOT_FOUND, message)
