"""`AsgiServer`: serves an application to browsers and programs; bounded whatever they do.

uvicorn speaks HTTP and WebSocket; what it lacks stands here and in `connection`: a client's time
for its request, how many may be at it, how much they may send, and who has to go for a new one.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
import ssl
from collections.abc import Sequence
from http import HTTPStatus

from h11 import LocalProtocolError
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from rid_daq.web.connection import Connection
from rid_daq.web.door import Door, Limits
from rid_daq.web.reception import Peer, Reception
from rid_daq.web.turns import NoTurnError, Turn, Turns
from rid_daq.web.uvicorn_parts import Uvicorn

LAST_WORDS_S = 0.5
_BACKLOG = 1024
_ACCEPTED_AT_ONCE = 8  # then those who are there are heard, before more come in
_CONNECTION = "rid_daq_connection"
_CLOSE = (b"connection", b"close")
_EVENTS = b"text/event-stream"


class AsgiServer:
    """Serves one application; every connection carries one request, or one stream.

    The application finds in `scope["state"]["local"]` whether a request came by a Unix socket. It
    gets a request when all of it is there. A WebSocket, or an answer of type `text/event-stream`,
    is a stream: `Limits.streams` of them may stay, another gets 503.

    Args:
        app: What answers.
        tls: How connections by TCP are encrypted, None where they are not.
        limits: What clients may take.
        reception: Decides about requests by their heads, before the application sees them.
    """

    def __init__(
        self,
        app: ASGIApp,
        tls: ssl.SSLContext | None = None,
        limits: Limits | None = None,
        reception: Reception | None = None,
    ) -> None:
        self.limits = limits or Limits()
        self._app = app
        self._tls = tls
        self._reception = reception
        self._turns = Turns()
        self._uvicorn = Uvicorn(self._answer, self.limits.message_bytes, self.limits.stream_s / 2)
        self._doors: list[Door] = []
        self._adopting: dict[bool, Door] = {}
        self._adoptions: set[asyncio.Task[object]] = set()

    @property
    def streams(self) -> int:
        """How many streams there are now."""
        return sum(len(door.streams) for door in self._doors)

    async def serve(
        self,
        listeners: Sequence[socket.socket],
        until: asyncio.Event,
        last_words_s: float = LAST_WORDS_S,
    ) -> None:
        """Serve on sockets that are bound, until the event is set; they are closed then.

        From then on nobody is let in; answers and streams have `last_words_s` to end by themselves.
        A WebSocket that has not is told 1012, and the application's tasks are cancelled.

        Args:
            listeners: By TCP (with TLS where there is a context) and Unix sockets (without).
            until: Ends it.
            last_words_s: How long the end may take.

        Raises:
            RuntimeError: The application's start has failed.
        """
        lifespan = self._uvicorn.lifespan()
        await lifespan.startup()
        if lifespan.should_exit:
            raise RuntimeError("the application did not start")
        try:
            async with contextlib.AsyncExitStack() as stack:
                for local in (False, True):
                    self._adopting[local] = self._door(None, lifespan.state, local=local)
                for listener in listeners:
                    await self._open(listener, lifespan.state, stack)
                await until.wait()
            await self._end(last_words_s)
        finally:
            await self._abandon(last_words_s)
            await lifespan.shutdown()

    async def _open(
        self, listener: socket.socket, state: dict[str, object], stack: contextlib.AsyncExitStack
    ) -> None:
        local = listener.family == socket.AF_UNIX
        door = self._door(None if local else self._tls, state, local=local)
        server = await asyncio.get_running_loop().create_server(
            lambda: Connection(door), sock=listener, backlog=_ACCEPTED_AT_ONCE
        )
        stack.callback(server.close)
        listener.listen(_BACKLOG)

    def adopt(self, line: socket.socket, peer: Peer, received: bytes) -> None:
        """Serve a connection that another process has accepted, and read so far.

        Args:
            line: The connection, without TLS.
            peer: The client.
            received: What it has sent already.
        """
        door = self._adopting.get(peer.local)
        if door is None:
            line.close()
            return
        loop = asyncio.get_running_loop()
        adoption = loop.create_task(
            loop.connect_accepted_socket(lambda: Connection(door, peer, received), line)
        )
        self._adoptions.add(adoption)
        adoption.add_done_callback(self._adoptions.discard)

    def _door(self, tls: ssl.SSLContext | None, state: dict[str, object], *, local: bool) -> Door:
        def speaker(connection: Connection) -> asyncio.Protocol:
            own = {
                **state,
                "local": local,
                "address": connection.peer.address,
                _CONNECTION: connection,
            }
            return self._uvicorn.protocol(own)

        door = Door(self.limits, speaker, tls, local=local, reception=self._reception)
        self._doors.append(door)
        return door

    async def _end(self, last_words_s: float) -> None:
        for door in self._doors:
            door.dismiss_waiting()
        await self._until_empty(last_words_s)
        for door in self._doors:
            door.shut_down()
        await self._until_empty(last_words_s)

    async def _until_empty(self, patience_s: float) -> None:
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(patience_s):
                while any(door.connections for door in self._doors):
                    await asyncio.sleep(0.01)

    async def _abandon(self, patience_s: float) -> None:
        for door in self._doors:
            door.abort()
        tasks = self._uvicorn.tasks
        if tasks:
            await asyncio.wait(tasks, timeout=patience_s)
        tasks = self._uvicorn.tasks
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _answer(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Ask the application; uvicorn calls this."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        connection: Connection = scope["state"].pop(_CONNECTION)
        try:
            if scope["type"] == "websocket":
                await self._answer_websocket(connection, scope, receive, send)
            else:
                await self._answer_request(connection, scope, receive, send)
        except LocalProtocolError:  # what came behind the head was answered with 400 already
            connection.abort()
        finally:
            connection.answered()

    async def _answer_request(
        self, connection: Connection, scope: Scope, receive: Receive, send: Send
    ) -> None:
        try:
            body = await self._body(scope, receive, connection.body_bytes)
        except _TooLongError:
            await _refuse(send, HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
            return
        if body is None:
            return
        connection.request_is_whole()
        body_messages: list[Message] = [{"type": "http.request", "body": body, "more_body": False}]

        async def replayed() -> Message:
            return body_messages.pop() if body_messages else await receive()

        try:
            async with self._turns.of(connection.owner) as turn:
                await self._ask(connection, turn, scope, replayed, send)
        except NoTurnError:
            await _refuse(send, HTTPStatus.TOO_MANY_REQUESTS, (b"retry-after", b"1"))

    async def _ask(
        self,
        connection: Connection,
        turn: Turn,
        scope: Scope,
        receive: Receive,
        send: Send,
    ) -> None:
        """Ask the application; the turn ends with its work, before the client takes the answer."""
        refused = False

        async def reply(message: Message) -> None:
            nonlocal refused
            if message["type"] == "http.response.start":
                turn.give_back()
                headers = [(name.lower(), value) for name, value in message["headers"]]
                stream = any(n == b"content-type" and v.startswith(_EVENTS) for n, v in headers)
                if stream and not connection.become_stream():
                    refused = True
                    await _refuse(send, HTTPStatus.SERVICE_UNAVAILABLE, (b"retry-after", b"5"))
                    return
                message = {**message, "headers": [*headers, _CLOSE]}
            if not refused:
                await send(message)
                if message["type"] == "http.response.body" and not message.get("more_body"):
                    connection.answered()

        await self._app(scope, receive, reply)

    async def _answer_websocket(
        self, connection: Connection, scope: Scope, receive: Receive, send: Send
    ) -> None:
        connection.request_is_whole()
        refused = False

        async def reply(message: Message) -> None:
            nonlocal refused
            if message["type"] == "websocket.accept" and not connection.become_stream():
                refused = True
                status = HTTPStatus.SERVICE_UNAVAILABLE
                await _refuse(send, status, (b"retry-after", b"5"), kind="websocket.http.response")
            if refused:
                raise ConnectionAbortedError
            await send(message)

        try:
            await self._app(scope, receive, reply)
        except Exception:
            if not refused:  # else the application was told, by an error, that nobody is there
                raise

    async def _body(self, scope: Scope, receive: Receive, most: int) -> bytes | None:
        """Return a request's whole body, None if the client has gone."""
        announced = dict(scope["headers"]).get(b"content-length", b"0")
        if int(announced) > most:
            raise _TooLongError
        body = bytearray()
        while (message := await receive())["type"] == "http.request":
            body += message.get("body", b"")
            if len(body) > most:
                raise _TooLongError
            if not message.get("more_body"):
                return bytes(body)
        return None


class _TooLongError(Exception):
    """A request with more than is taken."""


async def _refuse(
    send: Send, status: HTTPStatus, *headers: tuple[bytes, bytes], kind: str = "http.response"
) -> None:
    """Answer with a status and its name."""
    body = status.phrase.encode() + b"\n"
    plain = (b"content-type", b"text/plain; charset=utf-8")
    length = (b"content-length", str(len(body)).encode())
    start = {
        "type": f"{kind}.start",
        "status": int(status),
        "headers": [plain, length, _CLOSE, *headers],
    }
    await send(start)
    await send({"type": f"{kind}.body", "body": body})
