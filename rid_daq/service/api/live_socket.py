"""The WebSocket: what changes, what jobs say, the newest samples; held keys come back by it."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import Callable
from functools import partial
from http import HTTPStatus
from typing import Final

from fastapi import APIRouter, WebSocket, WebSocketDisconnect

from config.errors import LockedError, RidDaqError
from rid_daq.service.api.context import is_local
from rid_daq.service.doorkeeper import Doorkeeper
from rid_daq.service.logs import LOG
from rid_daq.service.records import Identity, Role
from rid_daq.service.service import CellService

router = APIRouter()

SAMPLES_S: Final = 0.05
"""The least time between two messages to a viewer [s]: twenty a second at most."""

KNOWN_S: Final = 1.0
"""How often a viewer's token is looked at again [s]."""

MOST_VIEWERS: Final = 64
TOO_MANY: Final = 1013
NO_TOKEN: Final = 1008
TOO_SLOW: Final = 1013


@router.websocket("/api/v1/ws")
async def look_on(socket: WebSocket) -> None:
    """Send a viewer what happens until it leaves.

    Messages to it have a `type`: `cell`, `job`, `event` or `samples`. It may send `{"job": ID,
    "lease": KEY, "held": KEY}` while a key is held, and `tapped` likewise.
    """
    service: CellService = socket.app.state.service
    door: Doorkeeper = socket.app.state.doorkeeper
    known = partial(door.look, socket.headers, local=is_local(socket))
    if known() is None:
        await socket.close(NO_TOKEN, HTTPStatus.UNAUTHORIZED.phrase)
        return
    if service.feed.viewers >= MOST_VIEWERS:
        await socket.close(TOO_MANY, "too many look on")
        return
    await socket.accept()
    beside = [
        asyncio.create_task(_send(socket, service)),
        asyncio.create_task(_watch(socket, known)),
    ]
    try:
        await _receive(socket, service, known)
    except (WebSocketDisconnect, RuntimeError, OSError):
        LOG.debug("a viewer has left")
    finally:
        for task in beside:
            task.cancel()
            with contextlib.suppress(
                asyncio.CancelledError, WebSocketDisconnect, RuntimeError, OSError
            ):
                await task


async def _send(socket: WebSocket, service: CellService) -> None:
    statuses = (service.status(cell) for cell in service.cells.values())
    first = [
        json.dumps({"type": "cell", "cell": status.model_dump(mode="json")}).encode()
        for status in statuses
    ]
    async with contextlib.aclosing(service.feed.view(first, SAMPLES_S)) as view:
        async for told in view:
            await socket.send_text(told.decode())
    await socket.close(TOO_SLOW, "too slow: events would be lost")


async def _watch(socket: WebSocket, known: Callable[[], Identity | None]) -> None:
    """End the socket of a viewer whose token is revoked."""
    while known() is not None:
        await asyncio.sleep(KNOWN_S)
    await socket.close(NO_TOKEN, HTTPStatus.UNAUTHORIZED.phrase)


async def _receive(
    socket: WebSocket, service: CellService, known: Callable[[], Identity | None]
) -> None:
    while True:
        try:
            told = json.loads(await socket.receive_text())
        except ValueError:
            continue
        who = known()
        if who is None:
            await socket.close(NO_TOKEN, HTTPStatus.UNAUTHORIZED.phrase)
            return
        if isinstance(told, dict) and who.role.includes(Role.OPERATOR):
            with contextlib.suppress(RidDaqError):
                _hold(service, told)


def _hold(service: CellService, told: dict[str, object]) -> None:
    """Pass on a held or tapped key of who has the cell.

    Raises
    ------
    LockedError
        Somebody else has it.
    UnknownError
        There is no such job.
    """
    job = service.job(str(told.get("job")))
    lease = told.get("lease")
    if not isinstance(lease, str):
        raise LockedError("show the lease")
    service.leases.require(job.cell, lease)
    held, tapped = told.get("held"), told.get("tapped")
    service.hold(
        job.id,
        held=held if isinstance(held, str) else None,
        tapped=tapped if isinstance(tapped, str) else None,
    )
