"""`BadLink`: a TCP proxy to a served cell that can stall, delay or cut connections.

Each connection to the service carries one request or one WebSocket, and is identified by its path.
The proxy has its own port. In each request head it replaces its own address with the service's.
"""

from __future__ import annotations

import asyncio
import contextlib
import random
import re
import threading
from collections.abc import Iterator

_HEAD = re.compile(rb"^([A-Z]+) (\S+) HTTP/1\.1\r\n")
_PIECE = 65536
_LOOK_S = 0.01


class BadLink:
    """A proxy on the loopback interface; its rules take effect at once, also for open connections.

    Args:
        port: Port of the service.

    Attributes:
        port: Port of the proxy.
        paths: Paths of all connections, in the order of their arrival.
    """

    def __init__(self, port: int) -> None:
        self.port = 0
        self.paths: list[str] = []
        self._to = port
        self._stalled: re.Pattern[str] | None = None
        self._passing = 0
        self._late: tuple[float, float, float] | None = None
        self._luck = random.Random(1)
        self._cut = False
        self._loop = asyncio.new_event_loop()
        self._listens = threading.Event()
        self._writers: set[asyncio.StreamWriter] = set()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def stall(self, paths: str) -> None:
        """Stop the traffic of connections with a matching path, in both directions."""
        self._stalled = re.compile(paths)

    def stall_after(self, passing: int, paths: str) -> None:
        """Let `passing` new connections with a matching path pass.

        The traffic of all later connections with a matching path stops.
        """
        self._passing = passing
        self.stall(paths)

    def make_late(self, share: float, least_s: float, most_s: float) -> None:
        """Delay a random fraction `share` of the received pieces by `least_s` to `most_s`.

        The order of a connection's data does not change.
        """
        self._late = (share, least_s, most_s)

    def cut(self) -> None:
        """Abort all connections, and each new connection, until `mend`."""
        self._cut = True
        self._loop.call_soon_threadsafe(self._end_all)

    def mend(self) -> None:
        """Remove all rules; data that were held back are sent now."""
        self._stalled = None
        self._late = None
        self._cut = False

    def _end_all(self) -> None:
        for writer in self._writers:
            writer.transport.abort()

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        server = self._loop.run_until_complete(
            asyncio.start_server(self._serve, "127.0.0.1", 0, limit=_PIECE)
        )
        self.port = server.sockets[0].getsockname()[1]
        self._listens.set()
        self._loop.run_forever()
        # asyncio raises AssertionError for a connection that is accepted after the server's end.
        for listening in server.sockets:
            self._loop.remove_reader(listening)
        self._loop.run_until_complete(asyncio.sleep(_LOOK_S))  # let accepted connections register
        server.close()
        self._end_all()
        while tasks := asyncio.all_tasks(self._loop):
            for task in tasks:
                task.cancel()
            self._loop.run_until_complete(asyncio.wait(tasks))
        self._end_all()
        self._loop.run_until_complete(
            asyncio.sleep(_LOOK_S)
        )  # let the event loop close the transports
        self._loop.close()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError, asyncio.IncompleteReadError, asyncio.CancelledError):
            await self._carry(reader, writer)
        writer.transport.abort()
        self._writers.discard(writer)

    async def _carry(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._writers.add(writer)
        if self._cut:
            return
        head = await reader.readuntil(b"\r\n\r\n")
        found = _HEAD.match(head)
        assert found is not None, head[:80]
        path = found[2].decode()
        self.paths.append(path)
        if self._passing and self._stalled is not None and self._stalled.search(path):
            self._passing -= 1
            path = ""  # no rule applies to this connection
        await self._wait(path)
        from_service, to_service = await asyncio.open_connection("127.0.0.1", self._to)
        self._writers.add(to_service)
        own, other = f"127.0.0.1:{self.port}".encode(), f"127.0.0.1:{self._to}".encode()
        to_service.write(head.replace(own, other))
        forth = asyncio.create_task(self._pump(reader, to_service, path))
        try:
            await self._pump(from_service, writer, path)
            writer.write_eof()
            await writer.drain()
        finally:
            forth.cancel()
            to_service.transport.abort()
            self._writers.discard(to_service)

    async def _pump(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, path: str
    ) -> None:
        while piece := await reader.read(_PIECE):
            await self._wait(path)
            writer.write(piece)
            await writer.drain()

    async def _wait(self, path: str) -> None:
        if self._late is not None:
            share, least_s, most_s = self._late
            if self._luck.random() < share:
                await asyncio.sleep(self._luck.uniform(least_s, most_s))
        while self._stalled is not None and self._stalled.search(path):
            await asyncio.sleep(_LOOK_S)


@contextlib.contextmanager
def bad_link(port: int) -> Iterator[BadLink]:
    """Yield a proxy to a port of the loopback interface; it runs until the `with` block ends."""
    link = BadLink(port)
    link._thread.start()
    link._listens.wait()
    try:
        yield link
    finally:
        link._loop.call_soon_threadsafe(link._loop.stop)
        link._thread.join()
