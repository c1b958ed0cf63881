"""The application server over real sockets with fast, slow, hanging and flooding clients.

No test depends on speed: a test waits for an answer or for the end of the connection.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import ssl
from collections.abc import AsyncIterator, Coroutine
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response, StreamingResponse
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect
from websockets.asyncio.client import connect, unix_connect
from websockets.exceptions import ConnectionClosedError, InvalidStatus

from rid_daq.web.asgi_server import AsgiServer
from rid_daq.web.connection_groups import Limits

PATIENCE_S = 120.0
SHORT = Limits(waiting=4, answering=4, streams=2, request_s=0.3, answer_s=0.3, stream_s=0.6)
LONG = Limits(request_s=PATIENCE_S, answer_s=PATIENCE_S)
ADDRESS = "127.0.0.1"
GET = b"GET / HTTP/1.1\r\nHost: x\r\n\r\n"
EVENTS = b"GET /events HTTP/1.1\r\nHost: x\r\n\r\n"


async def tell(request: Request) -> Response:
    body = (await request.body()).decode()
    return JSONResponse({"local": request.state.local, "body": body})


async def fail(request: Request) -> Response:
    raise ZeroDivisionError


async def big(request: Request) -> Response:
    return Response(b"x" * (16 << 20))


async def events(request: Request) -> Response:
    async def lines() -> AsyncIterator[bytes]:
        yield b"data: 1\n\n"
        await request.app.state.until.wait()
        yield b"data: last\n\n"

    return StreamingResponse(lines(), media_type="text/event-stream")


async def flood(request: Request) -> Response:
    async def lines() -> AsyncIterator[bytes]:
        while True:
            await asyncio.sleep(0)
            yield b"data: " + b"x" * 4096 + b"\n\n"

    return StreamingResponse(lines(), media_type="text/event-stream")


async def echo(websocket: WebSocket) -> None:
    await websocket.accept()
    with contextlib.suppress(WebSocketDisconnect):
        while True:
            await websocket.send_text(await websocket.receive_text())


@dataclass
class Place:
    """A running server with a TCP port and a local socket."""

    server: AsgiServer
    port: int
    path: Path
    until: asyncio.Event
    serving: asyncio.Task[None]

    async def open(self, local: bool = False) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        if local:
            return await asyncio.open_unix_connection(self.path)
        return await asyncio.open_connection(ADDRESS, self.port)

    async def ask(self, sent: bytes, local: bool = False) -> tuple[int, bytes, bytes]:
        """Return status, head and body of the whole answer; status 0 without an answer."""
        reader, writer = await self.open(local)
        writer.write(sent)
        received = await read_to_end(reader)
        writer.close()
        head, _, body = received.partition(b"\r\n\r\n")
        return int(head.split()[1]) if head else 0, head, body

    async def end(self) -> None:
        self.until.set()
        await self.serving


async def read_to_end(reader: asyncio.StreamReader) -> bytes:
    received = b""
    with contextlib.suppress(ConnectionError):
        while data := await reader.read(65536):
            received += data
    return received


async def start_server(folder: Path, limits: Limits, tls: ssl.SSLContext | None = None) -> Place:
    until = asyncio.Event()
    app = Starlette(
        routes=[
            Route("/", tell, methods=["GET", "POST"]),
            Route("/fail", fail),
            Route("/big", big),
            Route("/events", events),
            Route("/flood", flood),
            WebSocketRoute("/ws", echo),
        ]
    )
    app.state.until = until
    server = AsgiServer(app, tls, limits)
    tcp = socket.create_server((ADDRESS, 0))
    port = tcp.getsockname()[1]
    unix = socket.socket(socket.AF_UNIX)
    unix.bind(str(folder / "door"))
    unix.listen()
    serving = asyncio.create_task(server.serve([tcp, unix], until))
    made = Place(server, port, folder / "door", until, serving)
    await made.ask(GET, local=True)
    return made


def run(main: Coroutine[Any, Any, None]) -> None:
    async def within() -> None:
        async with asyncio.timeout(PATIENCE_S):
            await main

    asyncio.run(within())


def test_the_application_is_reached_by_port_and_socket_and_can_distinguish_them(
    tmp_path: Path,
) -> None:
    async def main() -> None:
        made = await start_server(tmp_path, LONG)
        for local in (False, True):
            status, head, body = await made.ask(GET, local)
            assert (status, json.loads(body)) == (200, {"local": local, "body": ""})
            assert b"connection: close" in head
            assert b"server" not in head.lower()
        await made.end()
        with pytest.raises(ConnectionRefusedError):
            await made.open()

    run(main())


def test_a_request_sent_in_single_bytes_is_answered(tmp_path: Path) -> None:
    async def main() -> None:
        made = await start_server(tmp_path, LONG)
        reader, writer = await made.open()
        line = writer.get_extra_info("socket")
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for byte in b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 3\r\n\r\nabc":
            writer.write(bytes((byte,)))
            await asyncio.sleep(0)
        assert b'"body":"abc"' in await read_to_end(reader)
        writer.close()
        chunked = b"POST / HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n"
        status, _, body = await made.ask(chunked + b"2\r\nab\r\n1\r\nc\r\n0\r\n\r\n")
        assert (status, json.loads(body)["body"]) == (200, "abc")
        await made.end()

    run(main())


@pytest.mark.parametrize(
    "sent",
    [
        b"",
        b"GET / HTTP/1.1\r\nHos",
        b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 5\r\n\r\n{",
        b"POST / HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n3\r\nab",
    ],
)
def test_a_client_that_does_not_finish_its_request_is_disconnected(
    tmp_path: Path, sent: bytes
) -> None:
    async def main() -> None:
        made = await start_server(tmp_path, SHORT)
        assert (await made.ask(sent))[0] == 0
        assert (await made.ask(GET))[0] == 200
        await made.end()

    run(main())


def test_a_client_that_does_not_read_its_answer_is_disconnected(tmp_path: Path) -> None:
    async def main() -> None:
        made = await start_server(tmp_path, SHORT)
        line = socket.create_connection(("127.0.0.1", made.port))
        line.sendall(GET.replace(b"/ ", b"/big ", 1))
        while not any(groups.answering for groups in made.server._groups):
            await asyncio.sleep(0)
        while any(groups.connections for groups in made.server._groups):
            await asyncio.sleep(0.01)
        line.close()
        assert (await made.ask(GET))[0] == 200
        await made.end()

    run(main())


def test_an_oversized_head_or_body_is_refused(tmp_path: Path) -> None:
    async def main() -> None:
        made = await start_server(tmp_path, LONG)
        head = b"POST / HTTP/1.1\r\nHost: x\r\nX: " + b"y" * (LONG.head_bytes + 1)
        assert (await made.ask(head))[0] in (431, 0), (
            "431, or 0 (no answer) if the client sent more than the server read"
        )
        assert (await made.ask(head + b"\r\n\r\n"))[0] in (431, 0)
        long = b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: %d\r\n\r\n" % (LONG.body_bytes + 1)
        reader, writer = await made.open()
        writer.write(long + b"x" * (LONG.body_bytes + 1))
        assert b" 413 " in await reader.readline()
        writer.close()
        await made.end()

    run(main())


def test_a_new_connection_displaces_the_oldest_of_the_same_listener(tmp_path: Path) -> None:
    async def main() -> None:
        limits = Limits(waiting=4, request_s=PATIENCE_S)
        made = await start_server(tmp_path, limits)
        beside = await made.open(local=True)
        crowd = [await made.open() for _ in range(20)]
        for reader, _ in crowd[:-4]:
            assert await read_to_end(reader) == b"", "the oldest connections are closed"
        assert (await made.ask(GET))[0] == 200, "a new connection is accepted"
        beside[1].write(GET)
        assert b" 200 " in await read_to_end(beside[0]), (
            "a connection of the other listener is kept"
        )
        for _, writer in (beside, *crowd):
            writer.close()
        await made.end()

    run(main())


def test_too_many_streams_are_refused_with_retry_after(tmp_path: Path) -> None:
    async def main() -> None:
        made = await start_server(tmp_path, Limits(streams=2))
        viewers = [await made.open() for _ in range(2)]
        for reader, writer in viewers:
            writer.write(EVENTS)
            assert b"data: 1" in await reader.readuntil(b"data: 1\n\n")
        assert made.server.streams == 2
        status, head, _ = await made.ask(EVENTS)
        assert status == 503
        assert b"retry-after: 5" in head.lower()
        with pytest.raises(InvalidStatus) as refused:
            await connect(f"ws://127.0.0.1:{made.port}/ws")
        assert refused.value.response.status_code == 503
        assert (await made.ask(GET))[0] == 200
        async with unix_connect(str(made.path), uri="ws://x/ws") as here:
            await here.send("from here")
            assert await here.recv() == "from here", "each listener has its own limit of streams"
        made.until.set()
        for reader, writer in viewers:
            assert b"data: last" in await read_to_end(reader), (
                "the last messages arrive before the end"
            )
            writer.close()
        await made.serving

    run(main())


def test_a_viewer_that_reads_nothing_is_disconnected_with_little_memory(tmp_path: Path) -> None:
    async def main() -> None:
        made = await start_server(tmp_path, SHORT)
        line = socket.create_connection(("127.0.0.1", made.port))
        line.sendall(EVENTS.replace(b"events", b"flood"))
        line.setblocking(False)
        while made.server.streams == 0:
            await asyncio.sleep(0.01)
        while made.server.streams:
            await asyncio.sleep(0.01)
        line.close()
        await made.end()

    run(main())


def test_a_websocket_is_served_and_closed_with_a_code_at_the_end(tmp_path: Path) -> None:
    async def main() -> None:
        made = await start_server(tmp_path, LONG)
        async with connect(f"ws://127.0.0.1:{made.port}/ws") as line:
            await line.send("ä")
            assert await line.recv() == "ä"
            await made.end()
            with pytest.raises(ConnectionClosedError) as closed:
                await line.recv()
            assert closed.value.rcvd is not None
            assert closed.value.rcvd.code == 1012

    run(main())


def test_a_too_long_message_closes_its_websocket(tmp_path: Path) -> None:
    async def main() -> None:
        made = await start_server(tmp_path, LONG)
        async with connect(f"ws://127.0.0.1:{made.port}/ws") as line:
            await line.send("x" * (LONG.message_bytes + 1))
            with pytest.raises(ConnectionClosedError) as closed:
                await line.recv()
            assert closed.value.rcvd is not None
            assert closed.value.rcvd.code == 1009
        await made.end()

    run(main())


def test_an_error_of_the_application_gives_an_answer_and_the_server_continues(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    async def main() -> None:
        made = await start_server(tmp_path, LONG)
        assert (await made.ask(GET.replace(b"/ ", b"/fail ", 1)))[0] == 500
        assert (await made.ask(GET))[0] == 200
        await made.end()

    run(main())
    assert "ZeroDivisionError" in caplog.text


@settings(max_examples=30)
@given(st.lists(st.binary(max_size=300), min_size=1, max_size=20), st.booleans())
def test_after_random_bytes_the_next_request_is_answered(
    tmp_path_factory: pytest.TempPathFactory, garbage: list[bytes], in_header: bool
) -> None:
    async def main() -> None:
        made = await start_server(tmp_path_factory.mktemp("any"), SHORT)
        start = b"GET / HTTP/1.1\r\nHost: " if in_header else b""
        answers = await asyncio.gather(*(made.ask(start + each + b"\r\n\r\n") for each in garbage))
        assert {status for status, _, _ in answers} <= {0, 200, 400, 403, 404, 405, 413, 431}
        assert (await made.ask(GET))[0] == 200
        await made.end()

    run(main())


def test_limits_apply_to_tls_from_the_first_byte(tmp_path: Path, certificate: Path) -> None:
    async def main() -> None:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(certificate)
        trust = ssl.create_default_context(cafile=str(certificate))
        trust.check_hostname = False
        limits = Limits(waiting=4, request_s=1.0)
        made = await start_server(tmp_path, limits, context)
        hanging = [await made.open() for _ in range(20)]

        async def ask() -> bytes:
            reader, writer = await asyncio.open_connection("127.0.0.1", made.port, ssl=trust)
            writer.write(GET)
            answer = await read_to_end(reader)
            writer.close()
            return answer

        assert b'"local":false' in await ask(), (
            "connections that hang in the TLS handshake are closed"
        )
        for reader, writer in hanging:
            assert await read_to_end(reader) == b""
            writer.close()
        assert (await made.ask(GET))[0] == 0, "plain text is refused"
        assert b'"local":false' in await ask()
        async with connect(f"wss://127.0.0.1:{made.port}/ws", ssl=trust) as line:
            await line.send("by tls")
            assert await line.recv() == "by tls"
        while any(groups.connections for groups in made.server._groups):
            await asyncio.sleep(0.01)
        await made.end()

    run(main())
