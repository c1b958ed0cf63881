"""The separate path of STOP over real sockets: locked database, access rules, stop lines."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import sqlite3
import time
from collections.abc import Coroutine
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.typing import Origin

from acquisition.supervision.stop_reason import StopCode
from acquisition.task.control_block import ControlBlock
from rid_daq.service.api.admission import Admission
from rid_daq.service.api.app import make_api
from rid_daq.service.authenticator import Authenticator
from rid_daq.service.records import JobState, Role
from rid_daq.service.refusals import StoreBusyError
from rid_daq.service.service import CellService
from rid_daq.service.stop.stop_endpoint import StopEndpoint
from rid_daq.service.store.state_folder import STATE_FOLDER
from rid_daq.web.access import Access, is_loopback
from rid_daq.web.asgi_server import AsgiServer
from rid_daq.web.connection_groups import Limits
from rid_daq.web.guard import Guard
from rid_daq.web.head_handler import OpenConnection, Peer, Reply
from rid_daq.web.request_head import RequestHead
from tests.rid_daq.service.conftest import Worker, job

PATIENCE_S = 120.0
STOP = "/api/v1/cells/ir361/stop"
FAR = Peer(local=False, address="192.0.2.7")
LONG = Limits(request_s=PATIENCE_S, answer_s=PATIENCE_S, stream_s=PATIENCE_S)


def run(main: Coroutine[Any, Any, None]) -> None:
    async def within() -> None:
        async with asyncio.timeout(PATIENCE_S):
            await main

    asyncio.run(within())


@dataclass
class Place:
    """A service that listens on a port of this computer."""

    service: CellService
    server: AsgiServer
    port: int
    until: asyncio.Event
    serving: asyncio.Task[None]

    def head(self, path: str = STOP, *more: str) -> bytes:
        lines = (f"POST {path} HTTP/1.1", f"Host: 127.0.0.1:{self.port}", "X-Rid-Daq: stop", *more)
        return "\r\n".join((*lines, "", "")).encode()

    async def ask(self, sent: bytes) -> tuple[int, dict[str, Any]]:
        reader, writer = await asyncio.open_connection("127.0.0.1", self.port)
        writer.write(sent)
        received = await reader.read()
        writer.close()
        head, _, body = received.partition(b"\r\n\r\n")
        return int(head.split()[1]), json.loads(body or b"{}")

    async def end(self) -> None:
        self.until.set()
        await self.serving


async def answer_on(line: ClientConnection) -> dict[str, Any]:
    """Return the next message that is not a heartbeat."""
    while True:
        message: dict[str, Any] = json.loads(await line.recv())
        if message["type"] != "beat":
            return message


async def place(service: CellService, limits: Limits = LONG) -> Place:
    listener = socket.create_server(("127.0.0.1", 0))
    access = Access("127.0.0.1", listener.getsockname()[1], "")
    door = Authenticator(service.tokens, access.port, secure=False)
    app = make_api(service, door)
    entrance = Admission(StopEndpoint(app.state.stop_handler, access), door, access)
    server = AsgiServer(Guard(app, access), None, limits, entrance)
    until = asyncio.Event()
    serving = asyncio.create_task(server.serve([listener], until))
    return Place(service, server, access.port, until, serving)


@contextlib.asynccontextmanager
async def moving(service: CellService) -> Any:
    """Start a job in this process, and yield the control block of its motion."""
    await service.job_runner.begin(job(), service.cell("ir361"), cleared=False)
    control = ControlBlock.create()
    try:
        yield control
    finally:
        control.program.declare_task_gone()


@pytest.mark.promise("stop-needs-nothing-else")
def test_a_stop_reaches_the_motion_while_another_program_locks_the_database(
    service: CellService, worker: Worker, tmp_path: Path
) -> None:
    async def main() -> None:
        made = await place(service)
        async with moving(service) as control:
            assert await asyncio.to_thread(service.database.flush, PATIENCE_S)
            file = tmp_path / STATE_FOLDER / "service.db"
            with contextlib.closing(sqlite3.connect(file)) as holder:
                holder.execute("BEGIN EXCLUSIVE")
                status, answer = await made.ask(made.head())
                assert (status, answer["sent"]) == (202, True)
                assert control.program.stop_code == StopCode.STOP_BUTTON
                assert holder.in_transaction, "the database is still locked"
        await made.end()
        noted = await asyncio.to_thread(service.audit.newest)
        assert [entry.what for entry in noted] == ["stopped"], (
            "the audit entry must be written after the lock has ended"
        )

    run(main())


def test_a_job_that_cannot_be_stored_does_not_start(
    service: CellService, worker: Worker, tmp_path: Path
) -> None:
    async def main() -> None:
        assert await asyncio.to_thread(service.database.flush, PATIENCE_S)
        file = tmp_path / STATE_FOLDER / "service.db"
        with contextlib.closing(sqlite3.connect(file)) as holder:
            holder.execute("BEGIN EXCLUSIVE")
            new_job = job()
            with pytest.raises(StoreBusyError) as refused:
                await service.job_runner.begin(new_job, service.cell("ir361"), cleared=True)
            assert refused.value.refusal == "RID-STORE-BUSY"
            assert not list(service.job_runner), "no worker runs the job"
            kept = service.jobs.get(new_job.id)
            assert kept is not None
            assert kept.state is JobState.FAILED
        assert await asyncio.to_thread(service.database.flush, PATIENCE_S)
        again = await service.job_runner.begin(job(), service.cell("ir361"), cleared=False)
        assert again.state is JobState.RUNNING, "another job can start"

    run(main())


@pytest.mark.promise("stop-needs-nothing-else")
@pytest.mark.parametrize(
    "more",
    [
        ("Content-Length: 17000000",),
        ("Transfer-Encoding: chunked",),
        ("Content-Type: text/plain", "Content-Length: 5"),
        ("Expect: 100-continue", "Content-Length: 2"),
    ],
)
def test_a_stop_is_answered_before_its_body(
    service: CellService, worker: Worker, more: tuple[str, ...]
) -> None:
    async def main() -> None:
        made = await place(service)
        async with moving(service) as control:
            status, answer = await made.ask(made.head(STOP, *more))
            assert (status, answer["sent"]) == (202, True)
            assert control.program.stop_code == StopCode.STOP_BUTTON
        await made.end()

    run(main())


def test_a_stop_of_all_cells_works_and_an_unknown_cell_is_refused(
    service: CellService, worker: Worker
) -> None:
    async def main() -> None:
        made = await place(service)
        async with moving(service) as control:
            status, answer = await made.ask(made.head("/api/v1/cells/other/stop"))
            assert (status, answer["code"]) == (404, "RID-CELL-UNKNOWN")
            assert not control.program.stop_code
            status, answer = await made.ask(made.head("/api/v1/stop"))
            assert (status, answer["sent"]) == (202, True)
            assert control.program.stop_code == StopCode.STOP_BUTTON
        await made.end()

    run(main())


def entrance_of(service: CellService) -> tuple[StopEndpoint, Authenticator]:
    access = Access("0.0.0.0", 8642, "")
    door = Authenticator(service.tokens, 8642, secure=False)
    app = make_api(service, door)
    return StopEndpoint(app.state.stop_handler, access), door


def stop_request(*more: str, path: str = STOP) -> RequestHead:
    lines = (f"POST {path} HTTP/1.1", "Host: 192.0.2.1:8642", "X-Rid-Daq: stop", *more)
    head = RequestHead.parse("\r\n".join(lines).encode())
    assert head is not None
    return head


def http_status(found: Reply | OpenConnection | None) -> int:
    assert isinstance(found, Reply)
    return int(found.status)


@pytest.mark.promise("stop-by-any-token-ever-issued")
def test_from_another_computer_any_issued_token_can_stop(service: CellService) -> None:
    entrance, _ = entrance_of(service)
    assert http_status(entrance.receive(stop_request(), FAR)) == 401
    assert http_status(entrance.receive(stop_request("Authorization: Bearer guessed"), FAR)) == 401
    token, secret = service.tokens.add("tablet", Role.VIEWER, person=True)
    shown = f"Authorization: Bearer {secret}"
    assert http_status(entrance.receive(stop_request(shown), FAR)) == 202
    service.tokens.revoke(token.id)
    assert http_status(entrance.receive(stop_request(shown), FAR)) == 202
    assert service.database.flush(PATIENCE_S)
    again = CellService(service.folder, list(service.cells.values()))
    entrance, _ = entrance_of(again)
    assert http_status(entrance.receive(stop_request(shown), FAR)) == 202, (
        "the token also stops after a restart"
    )
    cookie = f"Cookie: other=1; rid_daq_service_8642={secret}"
    assert http_status(entrance.receive(stop_request(cookie), FAR)) == 202


@pytest.mark.parametrize(
    ("line", "status"),
    [
        ("Origin: https://elsewhere.example", 403),
        ("Sec-Fetch-Site: cross-site", 403),
        ("X-Rid-Daq: again", 400),
        ("Host: elsewhere.example", 400),
    ],
)
def test_a_request_from_another_origin_stops_nothing(
    service: CellService, line: str, status: int
) -> None:
    entrance, _ = entrance_of(service)
    here = Peer(local=False, address="127.0.0.1")
    without = RequestHead("POST", STOP, (("host", "192.0.2.1:8642"),))
    for head, expected in ((stop_request(line), status), (without, 403)):
        refused = entrance.receive(head, here)
        assert isinstance(refused, Reply)
        assert (refused.status, refused.document["code"]) == (expected, "RID-ACCESS-SENDER")
    assert http_status(entrance.receive(stop_request(), here)) == 202


@pytest.mark.parametrize(
    ("address", "here"),
    [
        ("127.0.0.1", True),
        ("127.8.9.1", True),
        ("::1", True),
        ("::ffff:127.0.0.1", True),
        ("::ffff:192.0.2.7", False),
        ("fe80::1%eth0", False),
        ("192.0.2.7", False),
        ("", False),
    ],
)
def test_loopback_addresses_belong_to_this_computer(address: str, here: bool) -> None:
    assert is_loopback(address) is here


@pytest.mark.promise("stop-line")
def test_the_stop_line_stops_confirms_by_number_and_sends_heartbeats(
    service: CellService, worker: Worker
) -> None:
    async def main() -> None:
        made = await place(service)
        url = f"ws://127.0.0.1:{made.port}/api/v1/stop-line"
        async with moving(service) as control, connect(url) as line:
            for number, target in enumerate(("other", "ir361", "*", "ir361")):
                await line.send(json.dumps({"stop": target, "number": number}))
                answer = await answer_on(line)
                assert (answer["type"], answer["number"]) == ("stopped", number)
                assert answer["sent"] is (target != "other")
            assert control.program.stop_code == StopCode.STOP_BUTTON
            before_s = time.monotonic()
            for _ in range(4):
                assert json.loads(await line.recv()) == {"type": "beat"}
            assert time.monotonic() - before_s >= 0.7
        await made.end()

    run(main())


@pytest.mark.promise("stop-line")
def test_a_stop_that_arrives_with_the_close_of_its_line_counts(
    service: CellService, worker: Worker
) -> None:
    async def main() -> None:
        made = await place(service)
        url = f"ws://127.0.0.1:{made.port}/api/v1/stop-line"
        async with moving(service) as control, connect(url) as line:
            line.protocol.send_text(b'{"stop": "ir361", "number": 1}')
            line.protocol.send_close(1001)
            line.transport.write(b"".join(line.protocol.data_to_send()))
            await line.wait_closed()
            assert control.program.stop_code == StopCode.STOP_BUTTON
        await made.end()

    run(main())


@pytest.mark.parametrize("message", ["nonsense", "[" * 1000, '{"job": "1"}', "x" * 5000])
def test_an_invalid_message_closes_the_stop_line(service: CellService, message: str) -> None:
    async def main() -> None:
        made = await place(service)
        async with connect(f"ws://127.0.0.1:{made.port}/api/v1/stop-line") as line:
            await line.send(message)
            with pytest.raises(ConnectionClosed):
                await answer_on(line)
        async with connect(f"ws://127.0.0.1:{made.port}/api/v1/stop-line") as line:
            await line.send('{"stop": "*", "number": 1}')
        await made.end()

    run(main())


def test_a_page_of_another_origin_gets_no_stop_line(service: CellService) -> None:
    async def main() -> None:
        made = await place(service)
        with pytest.raises(InvalidStatus) as refused:
            await connect(
                f"ws://127.0.0.1:{made.port}/api/v1/stop-line",
                origin=Origin("https://elsewhere.example"),
            )
        assert refused.value.response.status_code == 403
        await made.end()

    run(main())


@pytest.mark.promise("stop-line")
def test_other_clients_cannot_displace_a_stop_line(service: CellService) -> None:
    async def main() -> None:
        made = await place(service, Limits(lines=6, lines_of_one=4))
        _, secret = service.tokens.add("tablet", Role.VIEWER, person=True)
        url = f"ws://127.0.0.1:{made.port}/api/v1/stop-line"
        shown = {"Authorization": f"Bearer {secret}"}
        async with contextlib.AsyncExitStack() as stack:
            first_line = await stack.enter_async_context(connect(url, additional_headers=shown))
            for _ in range(20):
                await stack.enter_async_context(connect(url))
            await first_line.send('{"stop": "*", "number": 7}')
            answer = await answer_on(first_line)
            assert answer["number"] == 7
        await made.end()

    run(main())


def test_the_main_websocket_also_stops_and_sends_heartbeats(
    service: CellService, worker: Worker
) -> None:
    async def main() -> None:
        made = await place(service)
        _, secret = service.tokens.add("tablet", Role.VIEWER, person=True)
        shown = {"Authorization": f"Bearer {secret}"}
        url = f"ws://127.0.0.1:{made.port}/api/v1/ws"
        async with (
            moving(service) as control,
            connect(url, additional_headers=shown) as line,
        ):
            await line.send('{"stop": "ir361", "number": 3}')
            kinds = set()
            while (answer := json.loads(await line.recv()))["type"] != "stopped":
                kinds.add(answer["type"])
            assert (answer["number"], answer["sent"]) == (3, True)
            assert control.program.stop_code == StopCode.STOP_BUTTON
            while (answer := json.loads(await line.recv()))["type"] != "beat":
                pass
        await made.end()

    run(main())
