"""Routes of STOP; a served request is answered before them, by `StopEntrance`."""

from __future__ import annotations

from http import HTTPStatus

from fastapi import APIRouter, Request

from rid_daq.service.api.context import is_local
from rid_daq.service.stop.stop_answer import ALL, StopAsked
from rid_daq.service.stop.stop_desk import StopDesk

router = APIRouter(prefix="/api/v1", tags=["stop"])


@router.post("/cells/{cell}/stop", status_code=HTTPStatus.ACCEPTED)
async def stop(cell: str, request: Request) -> StopAsked:
    """Stop the motion of a cell. No lease, no role, and on this computer no token is needed.

    The body is ignored. Elsewhere any token that was ever issued is enough, also a revoked one.
    """
    return _stop(cell, request)


@router.post("/stop", status_code=HTTPStatus.ACCEPTED)
async def stop_all(request: Request) -> StopAsked:
    """Stop the motions of all cells of this service, as `stop` does for one."""
    return _stop(ALL, request)


def _stop(target: str, request: Request) -> StopAsked:
    desk: StopDesk = request.app.state.stop_desk
    client = "" if request.client is None else request.client.host
    address = request.scope.get("state", {}).get("address", client)
    who = desk.admit(request.headers, local=is_local(request), address=address)
    return desk.stop(target, who)
