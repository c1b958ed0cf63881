"""Front process of the service: `python -m rid_daq.service.front DOCUMENT`.

Only the service starts it. It accepts all connections and answers STOP even if the service hangs.
"""

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
from rid_daq.service.front.connection_handover import ConnectionHandover
from rid_daq.service.front.front_stop_handler import FrontStopHandler
from rid_daq.service.front.message_channel import MessageChannel
from rid_daq.service.stop.stop_endpoint import StopEndpoint
from rid_daq.web.access import Access
from rid_daq.web.connection import Connection
from rid_daq.web.connection_groups import ConnectionGroups, Limits

LIMITS: Final = Limits(waiting=1024, answering=512, body_bytes=1 << 40, answer_s=30.0)
"""Limits of STOP connections and of incomplete requests; the service limits all other requests."""

NICENESS: Final = -10
_ACCEPTED_AT_ONCE: Final = 8
_BACKLOG: Final = 1024


async def serve(start: Mapping[str, Any]) -> None:
    """Serve until the service has closed its end of the message channel."""
    loop, over = asyncio.get_running_loop(), asyncio.Event()
    channel = MessageChannel(socket.socket(fileno=start["channel"]))

    def report_stop(target: str, who: str) -> None:
        channel.send({"stop": target, "who": who})

    handler = FrontStopHandler(start["cells"], report_stop)
    certificate = start["certificate"]
    access = Access(
        start["address"], start["port"], "", None if certificate is None else Path(certificate)
    )
    endpoint, tls = StopEndpoint(handler, access), access.tls()
    listener_groups, servers = [], []
    for descriptor in start["listeners"]:
        listener = socket.socket(fileno=descriptor)
        listener.setblocking(False)
        local = listener.family == socket.AF_UNIX
        groups = ConnectionGroups(
            LIMITS,
            lambda connection: ConnectionHandover(connection, channel),
            None if local else tls,
            local=local,
            head_handler=endpoint,
        )
        listener_groups.append(groups)

        def accept(groups: ConnectionGroups = groups) -> Connection:
            return Connection(groups)

        servers.append(await loop.create_server(accept, sock=listener, backlog=_ACCEPTED_AT_ONCE))
        listener.listen(_BACKLOG)

    def process_message(document: Mapping[str, Any], _data: bytes, _descriptor: int | None) -> None:
        if "issued" in document:
            handler.note_issued(document["issued"])
        if "jobs" in document:
            handler.note_jobs(document["jobs"])

    channel.begin(process_message, over.set)
    await over.wait()
    for server in servers:
        server.close()
    for groups in listener_groups:
        groups.abort_incomplete()
        groups.shut_down()
    await asyncio.sleep(0)
    for groups in listener_groups:
        groups.abort()


def main() -> None:
    """Run the front process. It ignores termination signals and ends together with the service."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    with contextlib.suppress(OSError):  # raising the priority needs a privilege
        os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
    keep_from_collections()
    asyncio.run(serve(json.loads(sys.argv[1])))


if __name__ == "__main__":
    main()
