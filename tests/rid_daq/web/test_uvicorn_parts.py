"""Properties of uvicorn on which our server depends."""

from __future__ import annotations

import asyncio
import inspect

import pytest
from h11 import LocalProtocolError
from starlette.types import Receive, Scope, Send
from uvicorn.config import Config
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.server import ServerState

from rid_daq.web.uvicorn_parts import HttpProtocol, Uvicorn

MALFORMED = b"HEAD / HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\nno chunk\r\n"


class Line(asyncio.Transport):
    """A connection that stores written data."""

    def __init__(self) -> None:
        super().__init__({"peername": ("127.0.0.1", 1), "sockname": ("127.0.0.1", 2)})
        self.written = b""
        self.aborted = False
        self.closed = False

    def write(self, data: bytes | bytearray | memoryview) -> None:
        self.written += bytes(data)

    def abort(self) -> None:
        self.aborted = True

    def close(self) -> None:
        self.closed = True

    def is_closing(self) -> bool:
        return self.closed or self.aborted

    def pause_reading(self) -> None:
        pass

    def resume_reading(self) -> None:
        pass


async def silent_app(scope: Scope, receive: Receive, send: Send) -> None:
    await receive()


def received(protocol: type[H11Protocol], data: bytes) -> Line:
    async def run() -> Line:
        config = Config(silent_app, http="h11", ws="none", lifespan="off", log_config=None)
        config.load()
        line = Line()
        one = protocol(config, ServerState(), {})
        one.connection_made(line)
        one.data_received(data)
        return line

    return asyncio.run(run())


def test_the_protocol_is_constructed_from_config_and_states() -> None:
    names = list(inspect.signature(H11Protocol.__init__).parameters)
    assert names[:4] == ["self", "config", "server_state", "app_state"]


def test_tasks_and_lifespan_have_their_expected_attributes() -> None:
    parts = Uvicorn(silent_app, 1000, 1.0)
    assert parts.tasks == ()
    assert isinstance(ServerState().tasks, set)
    assert {"startup", "shutdown", "should_exit", "state"} <= set(dir(parts.lifespan()))


def test_uvicorn_alone_still_fails_on_malformed_requests() -> None:
    """If this test fails, uvicorn has been corrected: delete our correction in `HttpProtocol`."""
    with pytest.raises(LocalProtocolError):
        received(H11Protocol, MALFORMED)


def test_a_malformed_request_closes_its_connection() -> None:
    assert received(HttpProtocol, MALFORMED).aborted
