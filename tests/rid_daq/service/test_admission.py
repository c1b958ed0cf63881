"""Admission of request bodies: after authentication only, and within each client's limits."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator

import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from rid_daq.service.api.admission import (
    FILE_BYTES,
    JSON_BYTES,
    OPEN_BURST,
    SMALL_BYTES,
    Admission,
    Rate,
)
from rid_daq.service.api.app import make_api
from rid_daq.service.authenticator import Authenticator
from rid_daq.service.hosting import LIMITS
from rid_daq.service.records import Role
from rid_daq.service.service import CellService
from rid_daq.service.stop.stop_endpoint import StopEndpoint
from rid_daq.web.access import Access
from rid_daq.web.head_handler import Admitted, OpenConnection, Peer, Reply
from rid_daq.web.request_head import RequestHead
from tests.rid_daq.service.test_stop_path import Place, place, run

HERE = Peer(local=False, address="127.0.0.1")
JOBS = "/api/v1/cells/ir361/jobs"
FILE = "/api/v1/files/model.json"
PAIRING = "/api/v1/pairing/state"


class Admissions:
    """Client with a token of each role; it returns the decisions of a service's admission."""

    def __init__(self, service: CellService) -> None:
        access = Access("127.0.0.1", 8642, "")
        door = Authenticator(service.tokens, 8642, secure=False)
        app = make_api(service, door)
        stop = StopEndpoint(app.state.stop_handler, access)
        self.admission = Admission(stop, door, access)
        self.secrets = {role: service.tokens.add(role.value, role, person=True)[1] for role in Role}

    def ask(
        self, role: Role | None, method: str, path: str, *more: str
    ) -> Reply | OpenConnection | Admitted:
        lines = [f"{method} {path} HTTP/1.1", "Host: 127.0.0.1:8642", "X-Rid-Daq: 1", *more]
        if role is not None:
            lines.append(f"Authorization: Bearer {self.secrets[role]}")
        head = RequestHead.parse("\r\n".join(lines).encode())
        assert head is not None
        return self.admission.receive(head, HERE)

    def largest_body(self, role: Role | None, method: str, path: str) -> int:
        found = self.ask(role, method, path)
        assert isinstance(found, Admitted)
        refused = self.ask(role, method, path, f"Content-Length: {found.body_bytes + 1}")
        assert isinstance(refused, Reply)
        assert refused.document["code"] == "RID-REQUEST-SIZE"
        return found.body_bytes


@pytest.fixture
def admissions(service: CellService) -> Admissions:
    return Admissions(service)


@pytest.mark.promise("known-before-a-body-is-read")
@pytest.mark.parametrize("length", ["Content-Length: 17000000", "Transfer-Encoding: chunked"])
@pytest.mark.parametrize(("method", "path"), [("POST", JOBS), ("PUT", FILE), ("POST", "/any")])
def test_a_request_without_authentication_is_refused_before_its_body(
    admissions: Admissions, method: str, path: str, length: str
) -> None:
    refused = admissions.ask(None, method, path, length)
    assert isinstance(refused, Reply)
    assert (refused.status, refused.document["code"]) == (401, "RID-ACCESS-UNKNOWN")


def test_a_request_from_another_origin_is_refused(admissions: Admissions) -> None:
    refused = admissions.ask(Role.ADMINISTRATOR, "POST", JOBS, "Origin: https://elsewhere.example")
    assert isinstance(refused, Reply)
    assert (refused.status, refused.document["code"]) == (403, "RID-ACCESS-SENDER")


@pytest.mark.promise("known-before-a-body-is-read")
def test_every_role_has_a_limit_of_the_body(admissions: Admissions) -> None:
    assert admissions.largest_body(Role.OPERATOR, "POST", JOBS) == JSON_BYTES
    assert admissions.largest_body(Role.ADMINISTRATOR, "POST", JOBS) == JSON_BYTES
    assert admissions.largest_body(Role.OPERATOR, "PUT", FILE) == FILE_BYTES
    assert admissions.largest_body(Role.VIEWER, "PUT", FILE) == SMALL_BYTES
    assert admissions.largest_body(Role.VIEWER, "POST", JOBS) == SMALL_BYTES
    assert admissions.largest_body(None, "POST", PAIRING) == SMALL_BYTES
    assert admissions.largest_body(Role.ADMINISTRATOR, "GET", JOBS) == 0


@pytest.mark.parametrize("length", ["-1", "1e3", "١", "", "0x10"])
def test_an_invalid_content_length_is_refused(admissions: Admissions, length: str) -> None:
    assert isinstance(
        admissions.ask(Role.OPERATOR, "POST", JOBS, f"Content-Length: {length}"), Reply
    )


def test_requests_without_a_token_have_a_rate_limit(admissions: Admissions) -> None:
    found = [admissions.ask(None, "POST", PAIRING) for _ in range(int(OPEN_BURST) + 20)]
    refused = [each for each in found if isinstance(each, Reply)]
    assert refused
    assert refused[0].document["code"] == "RID-REQUEST-RATE"


def test_each_owner_has_a_separate_rate_limit_that_recovers() -> None:
    now_s = 0.0
    rate = Rate(2.0, 1.0, lambda: now_s)
    assert [rate.allows("a") for _ in range(3)] == [True, True, False]
    assert rate.allows("b")
    now_s = 1.0
    assert [rate.allows("a") for _ in range(2)] == [True, False]


@contextlib.asynccontextmanager
async def served(service: CellService) -> AsyncIterator[tuple[Place, dict[str, str]]]:
    made = await place(service, LIMITS)
    _, secret = service.tokens.add("viewer", Role.VIEWER, person=True)
    yield made, {"Authorization": f"Bearer {secret}"}
    await made.end()


@pytest.mark.promise("known-before-a-body-is-read")
def test_a_refusal_arrives_while_the_body_is_still_being_sent(service: CellService) -> None:
    async def main() -> None:
        async with served(service) as (made, _):
            body = b"x" * 200_000
            head = made.head(JOBS, "Content-Type: application/json", "Content-Length: 200000")
            status, answer = await made.ask(head + body)
            assert (status, answer["code"]) == (401, "RID-ACCESS-UNKNOWN")

    run(main())


@pytest.mark.promise("sockets-of-one")
def test_one_viewer_cannot_occupy_all_websockets(service: CellService) -> None:
    async def main() -> None:
        async with served(service) as (made, viewer), contextlib.AsyncExitStack() as stack:
            url = f"ws://127.0.0.1:{made.port}/api/v1/ws"
            for _ in range(LIMITS.streams_of_one):
                await stack.enter_async_context(connect(url, additional_headers=viewer))
            with pytest.raises(InvalidStatus) as refused:
                await connect(url, additional_headers=viewer)
            assert refused.value.response.status_code == 503
            _, secret = service.tokens.add("operator", Role.OPERATOR, person=True)
            other = connect(url, additional_headers={"Authorization": f"Bearer {secret}"})
            line = await stack.enter_async_context(other)
            assert json.loads(await line.recv())["type"] == "cell"

    run(main())


async def until_closed(line: ClientConnection) -> int:
    try:
        while True:
            await line.recv()
    except ConnectionClosed as closed:
        return 0 if closed.rcvd is None else closed.rcvd.code


@pytest.mark.promise("sockets-of-one")
@pytest.mark.parametrize("message", ["x", "[" * 2000, '{"other": 1}', '{"job": "none"}'])
def test_invalid_messages_and_floods_close_a_websocket(service: CellService, message: str) -> None:
    async def main() -> None:
        async with served(service) as (made, viewer):
            url = f"ws://127.0.0.1:{made.port}/api/v1/ws"
            async with connect(url, additional_headers=viewer) as line:
                closed = asyncio.create_task(until_closed(line))
                with contextlib.suppress(ConnectionClosed):
                    while not closed.done():
                        await line.send(message)
                        await asyncio.sleep(0)
                assert await closed in (0, 1006, 1008)

    run(main())


@pytest.mark.promise("sockets-of-one")
def test_a_flood_of_pings_closes_a_websocket(service: CellService) -> None:
    async def main() -> None:
        async with served(service) as (made, viewer):
            for path in ("ws", "stop-line"):
                url = f"ws://127.0.0.1:{made.port}/api/v1/{path}"
                async with connect(url, additional_headers=viewer) as line:
                    closed = asyncio.create_task(until_closed(line))
                    pings = b"\x89\x80\x00\x00\x00\x00" * 100_000
                    line.transport.write(pings)
                    assert await closed in (0, 1006)

    run(main())
