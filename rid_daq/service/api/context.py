"""Arguments of the routes: the service, the caller, and the cell or job of the URL."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Annotated

from fastapi import Depends
from starlette.requests import HTTPConnection

from rid_daq.service.authenticator import Authenticator
from rid_daq.service.records import Identity, Job, Role
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.service import CellService, require_role


def is_local(connection: HTTPConnection) -> bool:
    """Return True if a request arrived through the Unix socket, which only this user can open."""
    return bool(connection.scope.get("state", {}).get("local"))


async def _service(connection: HTTPConnection) -> CellService:
    service: CellService = connection.app.state.service
    return service


async def _authenticator(connection: HTTPConnection) -> Authenticator:
    authenticator: Authenticator = connection.app.state.authenticator
    return authenticator


Service = Annotated[CellService, Depends(_service)]
Auth = Annotated[Authenticator, Depends(_authenticator)]


def credentials(connection: HTTPConnection, authenticator: Authenticator) -> Mapping[str, str]:
    """Return the headers that identify the sender.

    A browser sends no bearer token when it opens a link; a ticket in the URL then replaces it.
    """
    ticket = connection.query_params.get("ticket")
    if ticket is None or connection.scope.get("method") != "GET":
        return connection.headers
    secret = authenticator.tickets.redeem(ticket, connection.scope["path"])
    return connection.headers if secret is None else {"authorization": f"Bearer {secret}"}


async def _who(connection: HTTPConnection, authenticator: Auth) -> Identity:
    return authenticator.require_identity(
        credentials(connection, authenticator), local=is_local(connection)
    )


Who = Annotated[Identity, Depends(_who)]


async def _administrator(who: Who) -> Identity:
    require_role(who, Role.ADMINISTRATOR)
    return who


async def _operator(who: Who) -> Identity:
    require_role(who, Role.OPERATOR)
    return who


Administrator = Annotated[Identity, Depends(_administrator)]
Operator = Annotated[Identity, Depends(_operator)]


async def _cell(cell: str, service: Service, who: Who) -> ServedCell:
    return service.cell(cell)


async def _job(job: str, service: Service, who: Who) -> Job:
    kept = service.jobs.in_memory(job)
    return await asyncio.to_thread(service.job, job) if kept is None else kept


OfCell = Annotated[ServedCell, Depends(_cell)]
OfJob = Annotated[Job, Depends(_job)]
