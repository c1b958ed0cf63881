"""`AsgiServer`: serves an application to browsers and programs, with limits for every client.

uvicorn provides HTTP and WebSocket. This file and `connection.py` add what uvicorn lacks: a timeout
for requests, limits of connections and data, and the choice of the connection that is closed for a
new one.
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
from rid_daq.web.connection_groups import ConnectionGroups, Limits
from rid_daq.web.fair_scheduler import FairScheduler, QueueFullError, Slot
from rid_daq.web.head_handler import HeadHandler, Peer
from rid_daq.web.uvicorn_parts import Uvicorn

LAST_WORDS_S = 0.5
_BACKLOG = 1024
_ACCEPTED_AT_ONCE = 8  # new connections accepted in a row, before open connections are served
_CONNECTION = "rid_daq_connection"
_CLOSE = (b"connection", b"close")
_EVENTS = b"text/event-stream"


class AsgiServer:
    """Serves one application; every connection carries one request, or one stream.

    `scope["state"]["local"]` tells the application if a request arrived through a Unix socket. The
    application receives a request when it is complete. A WebSocket, or an answer of type
    `text/event-stream`, is a stream: at most `Limits.streams` are open, a further one receives
    status 503.

    Args:
        app: The application.
        tls: TLS settings of TCP connections, None without TLS.
        limits: Limits of the clients.
        head_handler: Decides about requests from their heads, before the application receives them.
    """

    def __init__(
        self,
        app: ASGIApp,
        tls: ssl.SSLContext | None = None,
        limits: Limits | None = None,
        head_handler: HeadHandler | None = None,
    ) -> None:
        self.limits = limits or Limits()
        self._app = app
        self._tls = tls
        self._head_handler = head_handler
        self._scheduler = FairScheduler()
        self._uvicorn = Uvicorn(self._answer, self.limits.message_bytes, self.limits.stream_s / 2)
        self._groups: list[ConnectionGroups] = []
        self._adopting: dict[bool, ConnectionGroups] = {}
        self._adoptions: set[asyncio.Task[object]] = set()

    @property
    def streams(self) -> int:
        """Number of open streams."""
        return sum(len(groups.streams) for groups in self._groups)

    async def serve(
        self,
        listeners: Sequence[socket.socket],
        until: asyncio.Event,
        last_words_s: float = LAST_WORDS_S,
    ) -> None:
        """Serve on bound sockets until the event is set; then close them.

        After that no connection is accepted. Answers and streams have `last_words_s` to end by
        themselves. A WebSocket that is still open is closed with code 1012, and the application's
        tasks are cancelled.

        Args:
            listeners: TCP sockets (with TLS if `tls` is set) and Unix sockets (without TLS).
            until: Event that ends the server.
            last_words_s: Time for the end of answers and streams [s].

        Raises:
            RuntimeError: The application failed to start.
        """
        lifespan = self._uvicorn.lifespan()
        await lifespan.startup()
        if lifespan.should_exit:
            raise RuntimeError("the application did not start")
        try:
            async with contextlib.AsyncExitStack() as stack:
                for local in (False, True):
                    self._adopting[local] = self._new_groups(None, lifespan.state, local=local)
                for listener in listeners:
                    await self._listen(listener, lifespan.state, stack)
                await until.wait()
            await self._shut_down(last_words_s)
        finally:
            await self._cancel_rest(last_words_s)
            await lifespan.shutdown()

    async def _listen(
        self, listener: socket.socket, state: dict[str, object], stack: contextlib.AsyncExitStack
    ) -> None:
        local = listener.family == socket.AF_UNIX
        groups = self._new_groups(None if local else self._tls, state, local=local)
        server = await asyncio.get_running_loop().create_server(
            lambda: Connection(groups), sock=listener, backlog=_ACCEPTED_AT_ONCE
        )
        stack.callback(server.close)
        listener.listen(_BACKLOG)

    def adopt(self, line: socket.socket, peer: Peer, received: bytes) -> None:
        """Serve a connection that another process has accepted and partly read.

        Args:
            line: Socket of the connection, without TLS.
            peer: The client.
            received: Bytes that the other process has read.
        """
        groups = self._adopting.get(peer.local)
        if groups is None:
            line.close()
            return
        loop = asyncio.get_running_loop()
        adoption = loop.create_task(
            loop.connect_accepted_socket(lambda: Connection(groups, peer, received), line)
        )
        self._adoptions.add(adoption)
        adoption.add_done_callback(self._adoptions.discard)

    def _new_groups(
        self, tls: ssl.SSLContext | None, state: dict[str, object], *, local: bool
    ) -> ConnectionGroups:
        def speaker(connection: Connection) -> asyncio.Protocol:
            own = {
                **state,
                "local": local,
                "address": connection.peer.address,
                _CONNECTION: connection,
            }
            return self._uvicorn.protocol(own)

        groups = ConnectionGroups(
            self.limits, speaker, tls, local=local, head_handler=self._head_handler
        )
        self._groups.append(groups)
        return groups

    async def _shut_down(self, last_words_s: float) -> None:
        for groups in self._groups:
            groups.abort_incomplete()
        await self._wait_until_empty(last_words_s)
        for groups in self._groups:
            groups.shut_down()
        await self._wait_until_empty(last_words_s)

    async def _wait_until_empty(self, patience_s: float) -> None:
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(patience_s):
                while any(groups.connections for groups in self._groups):
                    await asyncio.sleep(0.01)

    async def _cancel_rest(self, patience_s: float) -> None:
        for groups in self._groups:
            groups.abort()
        tasks = self._uvicorn.tasks
        if tasks:
            await asyncio.wait(tasks, timeout=patience_s)
        tasks = self._uvicorn.tasks
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _answer(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Call the application for a request; uvicorn calls this function."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        connection: Connection = scope["state"].pop(_CONNECTION)
        try:
            if scope["type"] == "websocket":
                await self._answer_websocket(connection, scope, receive, send)
            else:
                await self._answer_request(connection, scope, receive, send)
        except LocalProtocolError:
            # uvicorn has already answered invalid data after the head with status 400
            connection.abort()
        finally:
            connection.note_answered()

    async def _answer_request(
        self, connection: Connection, scope: Scope, receive: Receive, send: Send
    ) -> None:
        try:
            body = await self._read_body(scope, receive, connection.body_bytes)
        except _TooLongError:
            await _send_refusal(send, HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
            return
        if body is None:
            return
        connection.note_request_complete()
        body_messages: list[Message] = [{"type": "http.request", "body": body, "more_body": False}]

        async def replay() -> Message:
            return body_messages.pop() if body_messages else await receive()

        try:
            slot = await self._wait_for_slot(connection.owner, receive)
        except QueueFullError:
            await _send_refusal(send, HTTPStatus.TOO_MANY_REQUESTS, (b"retry-after", b"1"))
            return
        if slot is None:
            return
        try:
            await self._call_application(connection, slot, scope, replay, send)
        finally:
            slot.release()

    async def _wait_for_slot(self, owner: str, receive: Receive) -> Slot | None:
        """Wait for a slot; return None if the client closes its connection first.

        Otherwise requests that a page has given up would fill the queue of their owner.

        Raises:
            QueueFullError: Too many requests of this owner wait already.
        """
        waiting = asyncio.create_task(self._scheduler.acquire(owner))
        gone = asyncio.ensure_future(receive())
        await asyncio.wait((waiting, gone), return_when=asyncio.FIRST_COMPLETED)
        if gone.done() and not waiting.done() and gone.result()["type"] == "http.disconnect":
            waiting.cancel()
            return None
        gone.cancel()
        return await waiting

    async def _call_application(
        self,
        connection: Connection,
        slot: Slot,
        scope: Scope,
        receive: Receive,
        send: Send,
    ) -> None:
        """Call the application for a request.

        The slot is released when the answer begins, before the client has received it.
        """
        refused = False

        async def reply(message: Message) -> None:
            nonlocal refused
            if message["type"] == "http.response.start":
                slot.release()
                headers = [(name.lower(), value) for name, value in message["headers"]]
                stream = any(n == b"content-type" and v.startswith(_EVENTS) for n, v in headers)
                if stream and not connection.become_stream():
                    refused = True
                    await _send_refusal(
                        send, HTTPStatus.SERVICE_UNAVAILABLE, (b"retry-after", b"5")
                    )
                    return
                message = {**message, "headers": [*headers, _CLOSE]}
            if not refused:
                await send(message)
                if message["type"] == "http.response.body" and not message.get("more_body"):
                    connection.note_answered()

        await self._app(scope, receive, reply)

    async def _answer_websocket(
        self, connection: Connection, scope: Scope, receive: Receive, send: Send
    ) -> None:
        connection.note_request_complete()
        refused = False

        async def reply(message: Message) -> None:
            nonlocal refused
            if message["type"] == "websocket.accept" and not connection.become_stream():
                refused = True
                status = HTTPStatus.SERVICE_UNAVAILABLE
                await _send_refusal(
                    send, status, (b"retry-after", b"5"), kind="websocket.http.response"
                )
            if refused:
                raise ConnectionAbortedError
            await send(message)

        try:
            await self._app(scope, receive, reply)
        except Exception:
            if not refused:  # after a refusal, `reply` itself has caused the exception
                raise

    async def _read_body(self, scope: Scope, receive: Receive, most: int) -> bytes | None:
        """Return the complete body of a request, None if the client has closed the connection."""
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
    """The body of a request is too long."""


async def _send_refusal(
    send: Send, status: HTTPStatus, *headers: tuple[bytes, bytes], kind: str = "http.response"
) -> None:
    """Answer with a status code and its name."""
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
