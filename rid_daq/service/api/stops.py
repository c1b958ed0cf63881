"""Routes of STOP in the API's documentation.

In a running service, `StopEndpoint` answers STOP requests before they reach these routes.
"""

from __future__ import annotations

from http import HTTPStatus

from fastapi import APIRouter, Request

from rid_daq.service.api.context import is_local
from rid_daq.service.stop.stop_answer import ALL, StopAnswer
from rid_daq.service.stop.stop_handler import ServiceStopHandler

router = APIRouter(prefix="/api/v1", tags=["stop"])


@router.post("/cells/{cell}/stop", status_code=HTTPStatus.ACCEPTED)
async def stop(cell: str, request: Request) -> StopAnswer:
    """Stop the motion of a cell. It needs no lease and no role, and on this computer no token.

    The body is ignored. From other computers, any token that was ever issued suffices, even a
    revoked one.
    """
    return _stop(cell, request)


@router.post("/stop", status_code=HTTPStatus.ACCEPTED)
async def stop_all(request: Request) -> StopAnswer:
    """Stop the motions of all cells of this service; the rules of `stop` apply."""
    return _stop(ALL, request)


def _stop(target: str, request: Request) -> StopAnswer:
    handler: ServiceStopHandler = request.app.state.stop_handler
    client = "" if request.client is None else request.client.host
    address = request.scope.get("state", {}).get("address", client)
    who = handler.identify_sender(request.headers, local=is_local(request), address=address)
    return handler.stop(target, who)
