"""`Uvicorn`: the HTTP and WebSocket protocols of uvicorn, without its server.

Only this file imports uvicorn. `AsgiServer` accepts and limits connections itself, for which
uvicorn has no public interface. `tests/rid_daq/web/test_uvicorn_parts.py` fails if uvicorn changes
an interface that is used here, or no longer needs the correction in `HttpProtocol`.
"""

from __future__ import annotations

import asyncio

from h11 import LocalProtocolError
from starlette.types import ASGIApp
from uvicorn.config import Config
from uvicorn.lifespan.off import LifespanOff
from uvicorn.lifespan.on import LifespanOn
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.server import ServerState


class HttpProtocol(H11Protocol):
    """Protocol of uvicorn, corrected for some malformed requests.

    If a HEAD request becomes malformed, uvicorn answers with a body. h11 then raises an exception,
    because an answer to HEAD must not have a body.
    """

    def data_received(self, data: bytes) -> None:
        """Process bytes of a client; close the connection if it cannot be answered."""
        try:
            super().data_received(data)
        except LocalProtocolError:
            self.transport.abort()


class Uvicorn:
    """Creates one protocol per connection for an application.

    Args:
        app: The application.
        message_bytes: Maximum size of a WebSocket message.
        ping_s: Period and timeout of WebSocket pings [s].
    """

    def __init__(self, app: ASGIApp, message_bytes: int, ping_s: float) -> None:
        self._state = ServerState()
        self._config = Config(
            app,
            http="h11",
            ws="websockets-sansio",
            ws_max_size=message_bytes,
            ws_ping_interval=ping_s,
            ws_ping_timeout=ping_s,
            ws_per_message_deflate=False,
            interface="asgi3",
            log_config=None,
            log_level="error",  # requests of unknown clients are not logged
            access_log=False,
            proxy_headers=False,
            server_header=False,
            date_header=False,
        )
        self._config.load()

    @property
    def tasks(self) -> tuple[asyncio.Task[None], ...]:
        """Running tasks of the application."""
        return tuple(self._state.tasks)

    def lifespan(self) -> LifespanOff | LifespanOn:
        """Return the object that starts and ends the application."""
        own: LifespanOff | LifespanOn = self._config.lifespan_class(self._config)
        return own

    def protocol(self, state: dict[str, object]) -> HttpProtocol:
        """Return the protocol of one connection, whose requests contain a copy of `state`."""
        return HttpProtocol(self._config, self._state, state)
