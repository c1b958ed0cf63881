"""What routes are given: the service, who asks, and the cell or job of the address."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Annotated

from fastapi import Depends
from starlette.requests import HTTPConnection

from rid_daq.service.doorkeeper import Doorkeeper
from rid_daq.service.records import Identity, Job, Role
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.service import CellService, require_role


def is_local(connection: HTTPConnection) -> bool:
    """Return whether a request came by the socket that only this user can open."""
    return bool(connection.scope.get("state", {}).get("local"))


async def _service(connection: HTTPConnection) -> CellService:
    service: CellService = connection.app.state.service
    return service


async def _doorkeeper(connection: HTTPConnection) -> Doorkeeper:
    doorkeeper: Doorkeeper = connection.app.state.doorkeeper
    return doorkeeper


Service = Annotated[CellService, Depends(_service)]
Door = Annotated[Doorkeeper, Depends(_doorkeeper)]


def credentials(connection: HTTPConnection, door: Doorkeeper) -> Mapping[str, str]:
    """Return the headers that say who asks.

    A browser gives no header to a link that it opens: a ticket in its address stands for one.
    """
    ticket = connection.query_params.get("ticket")
    if ticket is None or connection.scope.get("method") != "GET":
        return connection.headers
    secret = door.tickets.take(ticket, connection.scope["path"])
    return connection.headers if secret is None else {"authorization": f"Bearer {secret}"}


async def _who(connection: HTTPConnection, door: Door) -> Identity:
    return door.identity(credentials(connection, door), local=is_local(connection))


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
    kept = service.jobs.kept(job)
    return await asyncio.to_thread(service.job, job) if kept is None else kept


OfCell = Annotated[ServedCell, Depends(_cell)]
OfJob = Annotated[Job, Depends(_job)]
