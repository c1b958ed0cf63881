"""The process in front of the service: `python -m rid_daq.service.front DOCUMENT`, by it alone."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import signal
import socket
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from config.process.own_process import keep_from_collections
from rid_daq.service.front.front_desk import FrontDesk
from rid_daq.service.front.hand_over import HandOver
from rid_daq.service.front.wire import Wire
from rid_daq.service.stop.stop_entrance import StopEntrance
from rid_daq.web.access import Access
from rid_daq.web.connection import Connection
from rid_daq.web.door import Door, Limits

LIMITS: Final = Limits(waiting=1024, answering=512, body_bytes=1 << 40, answer_s=30.0)
"""What is handed on, the service bounds; here STOP's lines and heads that are not whole are."""

NICENESS: Final = -10
_ACCEPTED_AT_ONCE: Final = 8
_BACKLOG: Final = 1024


async def serve(told: Mapping[str, Any]) -> None:
    """Serve until the service has closed its end of the wire."""
    loop, over = asyncio.get_running_loop(), asyncio.Event()
    wire = Wire(socket.socket(fileno=told["wire"]))

    def tell(target: str, who: str) -> None:
        wire.send({"stop": target, "who": who})

    desk = FrontDesk(told["cells"], tell)
    certificate = told["certificate"]
    access = Access(
        told["address"], told["port"], "", None if certificate is None else Path(certificate)
    )
    entrance, tls = StopEntrance(desk, access), access.tls()
    doors, servers = [], []
    for descriptor in told["listeners"]:
        listener = socket.socket(fileno=descriptor)
        listener.setblocking(False)
        local = listener.family == socket.AF_UNIX
        door = Door(
            LIMITS,
            lambda connection: HandOver(connection, wire),
            None if local else tls,
            local=local,
            reception=entrance,
        )
        doors.append(door)

        def accept(door: Door = door) -> Connection:
            return Connection(door)

        servers.append(await loop.create_server(accept, sock=listener, backlog=_ACCEPTED_AT_ONCE))
        listener.listen(_BACKLOG)

    def received(document: Mapping[str, Any], _data: bytes, _descriptor: int | None) -> None:
        if "issued" in document:
            desk.note_issued(document["issued"])
        if "jobs" in document:
            desk.note_jobs(document["jobs"])

    wire.begin(received, over.set)
    await over.wait()
    for server in servers:
        server.close()
    for door in doors:
        door.dismiss_waiting()
        door.shut_down()
    await asyncio.sleep(0)
    for door in doors:
        door.abort()


def main() -> None:
    """Serve; whoever ends the service ends this process by it."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    with contextlib.suppress(OSError):  # only with the right to
        os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
    keep_from_collections()
    asyncio.run(serve(json.loads(sys.argv[1])))


if __name__ == "__main__":
    main()
