"""Held keys over a WebSocket need a valid token, role, lease and challenge.

The WebSocket of a revoked token is closed.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, MutableMapping
from contextlib import asynccontextmanager
from typing import Any

import pytest
from fastapi import FastAPI

from acquisition.hold_to_run.held_key import KeyMessage
from config.process.safety_clock import safety_now_s
from rid_daq.service.api import live_socket
from rid_daq.service.api.app import make_api
from rid_daq.service.api.challenges import IDLE_S, Challenges
from rid_daq.service.authenticator import Authenticator
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.records import HeldLease, Identity, Job, JobState, Role, Token
from rid_daq.service.service import CellService
from tests.builders.clock import Clock

JOB = Job(
    id="1",
    cell="ir361",
    kind=JobKind("jog"),
    state=JobState.RUNNING,
    owner="tablet",
    request={},
    created_s=0.0,
)


class Viewer:
    """The client's side of a WebSocket."""

    def __init__(self) -> None:
        self.sent: asyncio.Queue[MutableMapping[str, Any]] = asyncio.Queue()
        self.got: asyncio.Queue[MutableMapping[str, Any]] = asyncio.Queue()

    def say(self, **fields: object) -> None:
        self.sent.put_nowait({"type": "websocket.receive", "text": json.dumps(fields)})

    async def challenge(self) -> str:
        """Wait for the next challenge and return its value."""
        while (message := json.loads((await self.got.get())["text"]))["type"] != "challenge":
            pass
        assert message["job"] == JOB.id
        return str(message["value"])

    async def wait_for_close(self) -> tuple[int, str]:
        """Wait until the service closes the socket; return code and reason."""
        while (message := await self.got.get())["type"] != "websocket.close":
            pass
        return message["code"], message["reason"]


@asynccontextmanager
async def connected_viewer(app: FastAPI, secret: str) -> AsyncIterator[Viewer]:
    """Yield a viewer that has received the state of the cell."""
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
    return make_api(service, Authenticator(service.tokens, 0, secure=False))


class Keys:
    """Messages that the service has passed on to the worker of a hold-to-run job."""

    def __init__(self, service: CellService, monkeypatch: pytest.MonkeyPatch) -> None:
        self.passed_on: list[KeyMessage] = []
        self._came = asyncio.Event()
        service.jobs.add(JOB)
        monkeypatch.setattr(service, "jobs_wanting_keys", lambda: [JOB.id])
        monkeypatch.setattr(service, "forward_key", self._take)

    def _take(self, job: str, message: KeyMessage) -> None:
        assert job == JOB.id
        self.passed_on.append(message)
        self._came.set()

    async def next(self) -> KeyMessage:
        """Wait for a message, and return the newest one."""
        await self._came.wait()
        self._came.clear()
        return self.passed_on[-1]


@pytest.fixture
def keys(service: CellService, monkeypatch: pytest.MonkeyPatch) -> Keys:
    return Keys(service, monkeypatch)


@pytest.fixture
def lease(service: CellService, tablet: tuple[Token, str]) -> HeldLease:
    who = Identity(name="tablet", role=Role.OPERATOR, person=True, token=tablet[0].id)
    return service.leases.take("ir361", who, "", 3600.0)


def test_a_key_held_with_a_revoked_token_moves_nothing(
    app: FastAPI, service: CellService, tablet: tuple[Token, str], lease: HeldLease, keys: Keys
) -> None:
    token, secret = tablet

    async def jog() -> tuple[int, str]:
        async with connected_viewer(app, secret) as viewer:
            viewer.say(job="1", lease=lease.key, held="up", sequence=1)
            await keys.next()
            service.tokens.revoke(token.id)
            viewer.say(job="1", lease=lease.key, held="down", sequence=2)
            return await viewer.wait_for_close()

    assert asyncio.run(jog()) == (1008, "Unauthorized")
    assert [each.key for each in keys.passed_on] == ["up"]


def test_a_viewers_key_moves_nothing_even_with_a_lease(
    app: FastAPI, service: CellService, lease: HeldLease, keys: Keys
) -> None:
    _, secret = service.tokens.add("screen", Role.VIEWER, person=True)

    async def hold() -> None:
        async with connected_viewer(app, secret) as viewer:
            viewer.say(job="1", lease=lease.key, held="up", sequence=1)
            viewer.say(stop="ir361", number=7)  # the answer follows after the key was processed
            while json.loads((await viewer.got.get())["text"]).get("number") != 7:
                pass

    asyncio.run(hold())
    assert keys.passed_on == []


@pytest.mark.promise("held-key-fresh")
def test_a_held_key_is_forwarded_with_the_time_of_its_challenge(
    app: FastAPI, tablet: tuple[Token, str], lease: HeldLease, keys: Keys
) -> None:
    async def jog() -> tuple[KeyMessage, KeyMessage, KeyMessage]:
        async with connected_viewer(app, tablet[1]) as viewer:
            message = {"job": "1", "lease": lease.key, "held": "+"}
            value = await viewer.challenge()
            viewer.say(**message, sequence=1, challenge=value)
            with_answer = await keys.next()
            viewer.say(**message, sequence=2, challenge=value[::-1])
            guessed = await keys.next()
            viewer.say(**message, sequence=3)
            viewer.say(**message, challenge=value)  # without a sequence number
            return with_answer, guessed, await keys.next()

    before_s = safety_now_s()
    with_answer, guessed, without = asyncio.run(jog())
    assert before_s <= with_answer.issued_s <= safety_now_s()
    assert (guessed.issued_s, without.issued_s) == (0.0, 0.0)
    assert [each.sequence for each in keys.passed_on] == [1, 2, 3]


@pytest.mark.promise("held-key-one-connection")
def test_an_answer_counts_only_on_the_connection_of_its_challenge(
    app: FastAPI, tablet: tuple[Token, str], lease: HeldLease, keys: Keys
) -> None:
    async def jog() -> tuple[KeyMessage, KeyMessage]:
        async with (
            connected_viewer(app, tablet[1]) as one,
            connected_viewer(app, tablet[1]) as another,
        ):
            message = {"job": "1", "lease": lease.key, "held": "+", "sequence": 1}
            value = await one.challenge()
            one.say(**message, challenge=value)
            same_connection = await keys.next()
            another.say(**message, challenge=value)
            return same_connection, await keys.next()

    same_connection, foreign = asyncio.run(jog())
    assert same_connection.issued_s > 0.0
    assert foreign.issued_s == 0.0
    assert same_connection.sender != foreign.sender


@pytest.mark.promise("held-key-lease")
def test_a_key_with_an_ended_lease_is_not_forwarded(
    app: FastAPI,
    service: CellService,
    tablet: tuple[Token, str],
    lease: HeldLease,
    keys: Keys,
) -> None:
    who = Identity(name="anna", role=Role.OPERATOR, person=True, token=tablet[0].id)

    async def jog() -> tuple[KeyMessage, KeyMessage]:
        async with connected_viewer(app, tablet[1]) as viewer:
            viewer.say(job="1", lease=lease.key, held="+", sequence=1)
            first = await keys.next()
            anna = service.leases.take("ir361", who, "", 3600.0, confirmed="ir361")
            viewer.say(job="1", lease=lease.key, held="+", sequence=2)
            viewer.say(job="1", lease=anna.key, held="+", sequence=3)
            return first, await keys.next()

    first, second = asyncio.run(jog())
    assert [each.sequence for each in keys.passed_on] == [1, 3]
    assert first.sender != second.sender


def test_the_pause_between_challenges_adapts_to_the_link() -> None:
    clock = Clock()
    challenges = Challenges(clock)
    assert challenges.pause_s == IDLE_S
    for round_trip_s, pause_s in ((0.004, 0.02), (0.04, 0.02), (0.08, 0.06), (0.34, 0.1)):
        value = challenges.issue("1")["value"]
        clock.now_s += round_trip_s
        message = {"held": "+", "sequence": 1, "challenge": value}
        assert challenges.parse_key_message("1", "lease", message) is not None
        assert challenges.pause_s == pytest.approx(pause_s)
    clock.now_s += 1.0
    assert challenges.pause_s == IDLE_S, "nobody answers"


def test_the_socket_of_a_silent_viewer_closes_when_its_token_is_revoked(
    app: FastAPI,
    service: CellService,
    tablet: tuple[Token, str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    token, secret = tablet
    monkeypatch.setattr(live_socket, "KNOWN_S", 0.0)

    async def stream_to_viewer() -> tuple[int, str]:
        async with connected_viewer(app, secret) as viewer:
            service.tokens.revoke(token.id)
            return await viewer.wait_for_close()

    assert asyncio.run(stream_to_viewer()) == (1008, "Unauthorized")
