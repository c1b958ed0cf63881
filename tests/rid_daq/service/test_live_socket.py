"""The WebSocket of somebody whose token is revoked: it ends, and moves nothing any more."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, MutableMapping
from contextlib import asynccontextmanager
from typing import Any

import pytest
from fastapi import FastAPI

from rid_daq.service.api import live_socket
from rid_daq.service.api.app import make_api
from rid_daq.service.doorkeeper import Doorkeeper
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.records import Identity, Job, JobState, Role, Token
from rid_daq.service.service import CellService

JOB = Job(
    id="1",
    cell="ir361",
    kind=JobKind.JOG,
    state=JobState.RUNNING,
    owner="tablet",
    request={},
    created_s=0.0,
)


class Viewer:
    """A WebSocket as its client sees it."""

    def __init__(self) -> None:
        self.sent: asyncio.Queue[MutableMapping[str, Any]] = asyncio.Queue()
        self.got: asyncio.Queue[MutableMapping[str, Any]] = asyncio.Queue()

    def say(self, **told: str) -> None:
        self.sent.put_nowait({"type": "websocket.receive", "text": json.dumps(told)})

    async def ends(self) -> tuple[int, str]:
        """Wait until the service closes it; return its code and reason."""
        while (told := await self.got.get())["type"] != "websocket.close":
            pass
        return told["code"], told["reason"]


@asynccontextmanager
async def looking_on(app: FastAPI, secret: str) -> AsyncIterator[Viewer]:
    """Have a viewer for as long as the `with` lasts, one that has been told of the cell."""
    viewer = Viewer()
    viewer.sent.put_nowait({"type": "websocket.connect"})
    headers = [(b"authorization", f"Bearer {secret}".encode())]
    scope = {"type": "websocket", "path": "/api/v1/ws", "query_string": b"", "headers": headers}
    looking = asyncio.create_task(app(scope, viewer.sent.get, viewer.got.put))
    assert (await viewer.got.get())["type"] == "websocket.accept"
    assert json.loads((await viewer.got.get())["text"])["type"] == "cell"
    yield viewer
    viewer.sent.put_nowait({"type": "websocket.disconnect", "code": 1000})
    await looking


@pytest.fixture
def tablet(service: CellService) -> tuple[Token, str]:
    return service.tokens.add("tablet", Role.OPERATOR, person=True)


@pytest.fixture
def app(service: CellService) -> FastAPI:
    return make_api(service, Doorkeeper(service.tokens, 0, secure=False))


def test_a_key_that_is_held_with_a_revoked_token_moves_nothing(
    app: FastAPI,
    service: CellService,
    tablet: tuple[Token, str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    token, secret = tablet
    moved: list[str | None] = []
    passed_on = asyncio.Event()

    def hold(_job: str, *, held: str | None = None, tapped: str | None = None) -> None:
        moved.append(held or tapped)
        passed_on.set()

    monkeypatch.setattr(service, "hold", hold)
    service.jobs.add(JOB)
    who = Identity(name="tablet", role=Role.OPERATOR, person=True, token=token.id)
    lease = service.leases.take("ir361", who, "", 3600.0)

    async def jog() -> tuple[int, str]:
        async with looking_on(app, secret) as viewer:
            viewer.say(job="1", lease=lease.key, held="up")
            await passed_on.wait()
            service.tokens.revoke(token.id)
            viewer.say(job="1", lease=lease.key, held="down")
            return await viewer.ends()

    assert asyncio.run(jog()) == (1008, "Unauthorized")
    assert moved == ["up"]


def test_a_viewer_that_says_nothing_sees_no_more_once_its_token_is_revoked(
    app: FastAPI,
    service: CellService,
    tablet: tuple[Token, str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    token, secret = tablet
    monkeypatch.setattr(live_socket, "KNOWN_S", 0.0)

    async def look_on() -> tuple[int, str]:
        async with looking_on(app, secret) as viewer:
            service.tokens.revoke(token.id)
            return await viewer.ends()

    assert asyncio.run(look_on()) == (1008, "Unauthorized")
