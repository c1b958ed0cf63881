"""Held keys over real sockets: a service with a simulated cell, a client and a disturbing proxy."""

from __future__ import annotations

import asyncio
import contextlib
import json
import re
import tempfile
import time
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from websockets.asyncio.client import ClientConnection, connect

from acquisition.hold_to_run.held_key import CHALLENGE_LIMIT_S
from benchmarks.service_kills import CELL, require_answer, serving
from rid_daq.service.client import ServiceClient
from rid_daq.service.sockets import socket_path_of

NEAR, FAR = "127.0.0.1", "127.0.0.2"
LEASE_S: Final = 3600.0
PRESS_S: Final = 8.0
SEEN_S: Final = 0.15
"""Largest delay of the samples of the robot's motion that this benchmark receives [s]."""

MOVING: Final = 0.005
"""Fraction of a joint's velocity limit above which the joint counts as moving."""


@dataclass
class Proxy:
    """A TCP proxy with a delay; `stalled` stops the data to the service and from the service."""

    port: int
    delay_s: float = 0.0
    stalled: tuple[bool, bool] = (False, False)

    @contextlib.asynccontextmanager
    async def listening(self) -> AsyncIterator[None]:
        """Forward connections while the context is active."""
        passing: set[asyncio.Task[None]] = set()

        async def take(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            inner, outer = await asyncio.open_connection(NEAR, self.port)
            for number, (source, sink) in enumerate(((reader, outer), (inner, writer))):
                passing.add(asyncio.create_task(self._pass_on(source, sink, number)))

        server = await asyncio.start_server(take, FAR, self.port)
        try:
            yield
        finally:
            server.close()
            for task in passing:
                task.cancel()
            await asyncio.gather(*passing, return_exceptions=True)

    async def _pass_on(
        self, source: asyncio.StreamReader, sink: asyncio.StreamWriter, number: int
    ) -> None:
        queue: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue()

        async def read() -> None:
            while data := await source.read(65536):
                queue.put_nowait((time.monotonic() + self.delay_s, data))

        reading = asyncio.create_task(read())
        try:
            with contextlib.suppress(OSError):
                while True:
                    due_s, data = await queue.get()
                    await asyncio.sleep(max(0.0, due_s - time.monotonic()))
                    while self.stalled[number]:
                        await asyncio.sleep(0.002)
                    sink.write(data)
                    await sink.drain()
        finally:
            reading.cancel()
            sink.close()


class Holder:
    """A client that holds a key and answers each challenge at once."""

    def __init__(self, socket: ClientConnection, job: str, lease: str) -> None:
        self._socket, self._job, self._lease = socket, job, lease
        self._sequence = 0
        self._newest: str | None = None
        self._key = ""

    async def answer(self) -> None:
        """Answer challenges until the connection ends."""
        async for text in self._socket:
            message = json.loads(text)
            if message["type"] == "challenge":
                self._newest = message["value"]
                if self._key:
                    await self._say(self._key)

    async def hold(self, key: str) -> None:
        """Press a key; an empty string releases it."""
        await self._say("")
        self._key = key
        if key:
            await self._say(key)

    async def _say(self, key: str) -> None:
        self._sequence += 1
        message = {"job": self._job, "lease": self._lease, "held": key}
        more = {"sequence": self._sequence, "challenge": self._newest}
        await self._socket.send(json.dumps(message | more))


class Watcher:
    """Observer of motion and refused keys, connected to the service without the proxy."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket
        self.moving_s: list[float] = []
        self.refused: list[str] = []

    async def look(self) -> None:
        """Receive messages until the connection ends."""
        async for text in self._socket:
            message = json.loads(text)
            if message["type"] == "samples":
                joints = message["picture"]["joints"] or []
                shares = [abs(each["velocity"] or 0.0) / each["velocity_limit"] for each in joints]
                if max(shares, default=0.0) > MOVING:
                    self.moving_s.append(time.monotonic())
            elif message["type"] == "event" and message["event"]["kind"] == "key_refused":
                self.refused.append(message["event"]["text"])

    def has_moved(self, from_s: float, to_s: float = float("inf")) -> bool:
        """Return True if the robot moved in a time span."""
        return any(from_s <= each < to_s for each in self.moving_s)


@dataclass
class RealLinks:
    """Results over sockets.

    Attributes:
        links: Number of links.
        late, restarts, unmoved: Number of links on which the robot moved too late, moved again
            without a new press, or did not move before the disturbance.
        loopback_s: Duration of the test on loopback [s].
        lost: Messages about presses that were lost on loopback.
    """

    links: int
    late: int
    restarts: int
    unmoved: int
    loopback_s: float
    lost: list[str]

    @property
    def sentence(self) -> str:
        """Sentence with the figures."""
        return (
            f"{self.links} links over sockets: {self.late} with motion too late, {self.restarts}"
            f" with a restart, {self.unmoved} without motion before the disturbance;"
            f" loopback for {self.loopback_s:.0f} s: {len(self.lost)} false releases"
            + "".join(f"\n  {each}" for each in self.lost)
        )

    @property
    def holds(self) -> bool:
        """True if all requirements are met."""
        return not (self.late or self.restarts or self.unmoved or self.lost)

    def document(self) -> dict[str, Any]:
        """Return the figures for the JSON line."""
        return {
            "socket_links": self.links,
            "socket_late": self.late,
            "socket_restarts": self.restarts,
            "socket_unmoved": self.unmoved,
            "loopback_s": self.loopback_s,
            "loopback_false_releases": len(self.lost),
        }


LINKS: Final = (
    ((True, False), 0.5, 0.0),
    ((True, False), 4.0, 0.0),
    ((False, True), 0.5, 0.0),
    ((False, True), 4.0, 0.0),
    ((True, True), 2.0, 0.0),
    ((False, False), 3.0, 1.0),
)
"""Links: stalled directions (to and from the service), duration of the stall [s], delay [s]."""


def real_links(loopback_s: float, ramp_s: float) -> RealLinks:
    """Hold keys of a service's simulated cell over sockets."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with serving(folder) as process:
            require_answer(folder, process)
            with ServiceClient.at(str(socket_path_of(folder))) as client:
                return asyncio.run(_measure(client, folder, loopback_s, ramp_s))


async def _measure(
    client: ServiceClient, folder: Path, loopback_s: float, ramp_s: float
) -> RealLinks:
    found = re.search(r"http://[^\s/]*:(\d+)/", (folder / "output").read_text())
    assert found is not None
    port = int(found[1])
    token = {"name": "holder", "role": "operator", "person": True}
    secret = (await asyncio.to_thread(client.ask, "POST", "/tokens", token))["secret"]
    lease = await asyncio.to_thread(
        client.ask, "POST", f"/cells/{CELL}/lease", {"seconds": LEASE_S}
    )
    key = str(lease["key"])
    await asyncio.to_thread(lambda: client.run(CELL, "check", {"seconds": 0.2}, lease=key))

    @contextlib.asynccontextmanager
    async def connected(host: str) -> AsyncIterator[ClientConnection]:
        headers = {"Authorization": f"Bearer {secret}"}
        address = f"ws://{host}:{port}/api/v1/ws"
        async with connect(
            address, additional_headers=headers, max_size=None, ping_interval=None
        ) as socket:
            yield socket

    result = RealLinks(len(LINKS), 0, 0, 0, loopback_s, [])
    proxy = Proxy(port)
    async with proxy.listening(), connected(NEAR) as direct:
        watcher = Watcher(direct)
        looking = asyncio.create_task(watcher.look())
        for stalled, time_s, delay_s in LINKS:
            async with _jog(client, key, connected, FAR, watcher) as holder:
                await holder.hold("1+")
                await asyncio.sleep(2.0)
                begun_s = time.monotonic()
                result.unmoved += not watcher.has_moved(begun_s - 1.0)
                proxy.stalled, proxy.delay_s = stalled, delay_s
                await asyncio.sleep(1.5)  # longer than the validity of a challenge
                still_s = time.monotonic()
                releasing = asyncio.create_task(holder.hold(""))
                await asyncio.sleep(time_s)
                proxy.stalled, proxy.delay_s = (False, False), 0.0
                await asyncio.sleep(2.0)
                await releasing
                allowed_s = begun_s + CHALLENGE_LIMIT_S + ramp_s + SEEN_S
                result.late += watcher.has_moved(allowed_s, still_s)
                result.restarts += watcher.has_moved(still_s)
        end_s = time.monotonic() + loopback_s
        while time.monotonic() < end_s:
            async with _jog(client, key, connected, NEAR, watcher) as holder:
                watcher.refused.clear()
                until_s = min(end_s, time.monotonic() + 240.0)  # a jog lasts 600 s at most
                direction = "+"
                while time.monotonic() < until_s:
                    direction = "-" if direction == "+" else "+"
                    await holder.hold(f"1{direction}")
                    await asyncio.sleep(PRESS_S)
                    await holder.hold("")
                    await asyncio.sleep(0.5)
                result.lost += watcher.refused
        looking.cancel()
    await asyncio.to_thread(client.stop, CELL)
    return result


@contextlib.asynccontextmanager
async def _jog(
    client: ServiceClient,
    lease: str,
    connected: Callable[[str], contextlib.AbstractAsyncContextManager[ClientConnection]],
    host: str,
    watcher: Watcher,
) -> AsyncIterator[Holder]:
    """Start a jog and yield a client that holds its keys; end it afterwards."""
    body = {"kind": "jog", "request": {}}
    job = await asyncio.to_thread(client.ask, "POST", f"/cells/{CELL}/jobs", body, lease)

    async def wait_for_event(words: str) -> None:
        while True:
            events = await asyncio.to_thread(client.ask, "GET", f"/jobs/{job['id']}/events")
            if any(words in each.get("text", "") for each in events):
                return
            await asyncio.sleep(0.1)

    await asyncio.wait_for(wait_for_event("Ready"), 120.0)
    watcher.moving_s.clear()
    async with connected(host) as socket:
        holder = Holder(socket, job["id"], lease)
        answering = asyncio.create_task(holder.answer())
        await asyncio.sleep(0.3)
        yield holder
        answering.cancel()
    await asyncio.to_thread(client.ask, "POST", f"/jobs/{job['id']}/cancel", {}, None)
    await asyncio.to_thread(lambda: client.follow(client.job(job["id"])))
    if client.cell(CELL).state.value != "ready":
        await asyncio.to_thread(lambda: client.run(CELL, "check", {"seconds": 0.2}, lease=lease))
