"""`Visit`: somebody's look at a page of a cell; it renders the page in the shell of all pages."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from http import HTTPStatus
from typing import Annotated, Any, Final

import jinja2
from fastapi import Depends, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse, RedirectResponse
from fastapi.routing import APIRoute
from starlette.exceptions import HTTPException
from starlette.responses import Response

from config.errors import RidDaqError
from rid_daq.service.api.context import OfCell, Service, Who
from rid_daq.service.doorkeeper import Doorkeeper
from rid_daq.service.logs import LOG
from rid_daq.service.records import Identity
from rid_daq.service.refusals import NotKnownError, status_of
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.service import CellService
from rid_daq.session.versions import program_version
from rid_daq.workbench.menu import MENU
from rid_daq.workbench.static_files import static_address

_TEMPLATES: Final = jinja2.Environment(
    loader=jinja2.PackageLoader("rid_daq.workbench"),
    autoescape=True,
    undefined=jinja2.StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)


def _utc(text: str) -> str:
    """Return a moment of a manifest as people read it, to the second."""
    return f"{text[:10]} {text[11:19]} UTC" if "T" in text else text


_TEMPLATES.filters["utc"] = _utc
_TEMPLATES.globals["static"] = static_address


@dataclass(frozen=True)
class Visit:
    """Somebody who is known looks at a page of a cell.

    Attributes:
        request: What the browser asked for.
        who: Who looks.
    """

    request: Request
    service: CellService
    who: Identity
    cell: ServedCell

    def page(
        self, template: str, /, status: HTTPStatus = HTTPStatus.OK, **context: Any
    ) -> HTMLResponse:
        """Return a page: a template that extends `base.html`; for routes that are `async`.

        Args:
            template: Its name in the folder `templates`.
            status: The answer's status.
            **context: What it shows beside what the shell does (`cell`, `status`, `who`, `menu`).
        """
        cell = self.cell
        base = f"/cells/{cell.name}"
        text = _TEMPLATES.get_template(template).render(
            cell=cell,
            cells=tuple(self.service.cells.values()),
            status=self.service.status(cell),
            who=self.who,
            menu=MENU,
            base=base,
            path=self.request.url.path.removeprefix(base),
            version=program_version(),
            **context,
        )
        return HTMLResponse(text, status)


def bare_page(template: str, /, status: HTTPStatus = HTTPStatus.OK, **context: Any) -> HTMLResponse:
    """Return a page without a cell: for unknown devices and addresses; its STOP stops all cells."""
    text = _TEMPLATES.get_template(template).render(version=program_version(), **context)
    return HTMLResponse(text, status)


def problem_page(status: HTTPStatus, message: str) -> HTMLResponse:
    """Return the page for an address that cannot be shown."""
    return bare_page("problem.html", status, message=message)


async def _visit(request: Request, service: Service, who: Who, cell: OfCell) -> Visit:
    return Visit(request, service, who, cell)


Visitor = Annotated[Visit, Depends(_visit)]
"""The parameter of a page's route: whose address has `{cell}` in it."""


_INTERNAL: Final = "Internal error; please report it with the service's log."


def _mistakes(error: RequestValidationError) -> str:
    """Return what is wrong in a page's address."""
    return "; ".join(f"{each['loc'][-1]}: {each['msg']}" for each in error.errors())


def door_page(key: str = "") -> HTMLResponse:
    """Return the page that fetches the page of its own address with this browser's session secret.

    Without TLS a browser cannot prove who it is when it goes to an address (see `Doorkeeper`).

    Args:
        key: The session secret of a browser that has just been let in.
    """
    return bare_page("door.html", key=key)


class PageRoute(APIRoute):
    """A route of a page: an unknown device comes to the pairing, and every error is a page too."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return what answers a request."""
        handler = super().get_route_handler()

        async def answer(request: Request) -> Response:
            door: Doorkeeper = request.app.state.doorkeeper
            try:
                return _renewed(await handler(request), request, door)
            except NotKnownError:
                if not door.secure and "authorization" not in request.headers:
                    return door_page()
                return RedirectResponse("/pair", HTTPStatus.SEE_OTHER)
            except RidDaqError as error:
                return problem_page(status_of(error), str(error))
            except HTTPException as error:
                return problem_page(HTTPStatus(error.status_code), str(error.detail))
            except RequestValidationError as error:
                return problem_page(HTTPStatus.UNPROCESSABLE_ENTITY, _mistakes(error))
            except Exception:
                LOG.exception("internal error on the page %s", request.url.path)
                return problem_page(HTTPStatus.INTERNAL_SERVER_ERROR, _INTERNAL)

        return answer


def _renewed(answer: Response, request: Request, door: Doorkeeper) -> Response:
    """Return an answer that keeps the device let in."""
    cookie = door.renewed_cookie(request.headers)
    if cookie is not None and "set-cookie" not in answer.headers:
        answer.headers["set-cookie"] = cookie
    return answer
