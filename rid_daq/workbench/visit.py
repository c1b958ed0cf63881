"""`Visit`: request of a known client for a page of a cell; it renders the page in its frame."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from datetime import UTC, datetime
from http import HTTPStatus
from typing import Annotated, Any, Final
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import jinja2
from fastapi import Depends, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse, RedirectResponse
from fastapi.routing import APIRoute
from starlette.exceptions import HTTPException
from starlette.responses import Response

from config.errors import RidDaqError
from rid_daq.service.api.context import OfCell, Service, Who
from rid_daq.service.authenticator import Authenticator
from rid_daq.service.logs import LOG
from rid_daq.service.records import Identity
from rid_daq.service.refusals import NotKnownError, http_status
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.service import CellService
from rid_daq.session.versions import program_version
from rid_daq.web.compressed import CompressedBody
from rid_daq.workbench.menu import MENU
from rid_daq.workbench.static_files import static_address

_TEMPLATES: Final = jinja2.Environment(
    loader=jinja2.PackageLoader("rid_daq.workbench"),
    autoescape=True,
    undefined=jinja2.StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)


_NOT_IN_BROWSERS: Final = ("posix/", "right/", "Factory")
"""Prefixes of zone names that this computer may know and that browsers reject."""


def _zone() -> str:
    """Return the IANA name of this computer's time zone; UTC without a name that browsers know."""
    link = os.path.realpath("/etc/localtime").partition("/zoneinfo/")[2]
    for name in (os.environ.get("TZ", "").lstrip(":"), link):
        with contextlib.suppress(ValueError, OSError, ZoneInfoNotFoundError):
            if not name.startswith(_NOT_IN_BROWSERS):
                return ZoneInfo(name).key
    return "UTC"


ZONE: Final = _zone()
"""Time zone of all times on the pages: that of the service, whatever the browser's zone is."""


def _zoned(text: str) -> str:
    """Return a time of a manifest in the service's time zone, with the zone's name."""
    try:
        time = datetime.fromisoformat(text)
    except ValueError:  # there is no time yet, or the manifest was edited
        return text
    return f"{time.astimezone(UTC if ZONE == 'UTC' else ZoneInfo(ZONE)):%Y-%m-%d %H:%M %Z}"


_TEMPLATES.filters["zoned"] = _zoned
_TEMPLATES.globals["zone"] = ZONE
_TEMPLATES.globals["static"] = static_address


@dataclass(frozen=True)
class Visit:
    """Request of a known client for a page of a cell.

    Attributes:
        request: Request of the browser.
        who: Identity of the client.
    """

    request: Request
    service: CellService
    who: Identity
    cell: ServedCell

    def page(
        self, template: str, /, status: HTTPStatus = HTTPStatus.OK, **context: Any
    ) -> HTMLResponse:
        """Return a page from a template that extends `base.html`; for routes that are `async`.

        Args:
            template: Name of the template in the folder `templates`.
            status: Status of the answer.
            **context: Values for the template, in addition to those of the frame (`cell`, `status`,
                `who`, `menu`).
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
        body, encoding = CompressedBody.of(text.encode()).for_client(self.request)
        return HTMLResponse(body, status, encoding)


def bare_page(template: str, /, status: HTTPStatus = HTTPStatus.OK, **context: Any) -> HTMLResponse:
    """Return a page without a cell, for unknown devices and addresses; its STOP stops all cells."""
    text = _TEMPLATES.get_template(template).render(version=program_version(), **context)
    return HTMLResponse(text, status)


def problem_page(status: HTTPStatus, message: str) -> HTMLResponse:
    """Return the page for an address that cannot be shown."""
    return bare_page("problem.html", status, message=message)


async def _visit(request: Request, service: Service, who: Who, cell: OfCell) -> Visit:
    return Visit(request, service, who, cell)


Visitor = Annotated[Visit, Depends(_visit)]
"""Parameter of a page's route whose address contains `{cell}`."""


_INTERNAL: Final = "Internal error; please report it with the service's log."


def _address_errors(error: RequestValidationError) -> str:
    """Return the errors in a page's address."""
    return "; ".join(f"{each['loc'][-1]}: {each['msg']}" for each in error.errors())


def login_page(key: str = "") -> HTMLResponse:
    """Return a page that loads the page of its own address with this browser's session secret.

    Without TLS a browser cannot identify itself when it opens an address (see `Authenticator`).

    Args:
        key: Session secret of a browser that has just logged in.
    """
    return bare_page("login.html", key=key)


class PageRoute(APIRoute):
    """Route of a page: unknown devices get the pairing page or login page; errors are pages too."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return the function that answers a request."""
        handler = super().get_route_handler()

        async def answer(request: Request) -> Response:
            authenticator: Authenticator = request.app.state.authenticator
            try:
                return _with_renewed_cookie(await handler(request), request, authenticator)
            except NotKnownError:
                if not authenticator.secure and "authorization" not in request.headers:
                    return login_page()
                return RedirectResponse("/pair", HTTPStatus.SEE_OTHER)
            except RidDaqError as error:
                return problem_page(http_status(error), str(error))
            except HTTPException as error:
                return problem_page(HTTPStatus(error.status_code), str(error.detail))
            except RequestValidationError as error:
                return problem_page(HTTPStatus.UNPROCESSABLE_ENTITY, _address_errors(error))
            except Exception:
                LOG.exception("internal error on the page %s", request.url.path)
                return problem_page(HTTPStatus.INTERNAL_SERVER_ERROR, _INTERNAL)

        return answer


def _with_renewed_cookie(
    answer: Response, request: Request, authenticator: Authenticator
) -> Response:
    """Return the answer with a cookie that extends the access of a paired device."""
    cookie = authenticator.renewed_cookie(request.headers)
    if cookie is not None and "set-cookie" not in answer.headers:
        answer.headers["set-cookie"] = cookie
    return answer
