"""The process that serves the live page; it looks on, and may die or hang without harm."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import resource
import socket
from typing import Any

from acquisition.supervision.stop_reason import StopCode
from acquisition.task.control_block import ControlBlock
from acquisition.task.ring import Ring
from config.process.termination import leave_terminal
from rid_daq.live.access import Access
from rid_daq.live.picture import MotionPicture, ShownMotion
from rid_daq.live.server import REQUEST_PATIENCE_S, LiveServer

PERIOD_S = 0.05
BACKLOG = 128
MOST_DESCRIPTORS = 256
LAST_WORDS_S = 0.5


def run_live_page(
    access: Access,
    listener: socket.socket,
    motion: ShownMotion,
    ring: Ring,
    control: ControlBlock,
    parent: int,
) -> None:
    """Serve the live page of one motion; the main function of its process.

    It ends with the motion. All it ever writes into shared memory is the request to stop.

    Parameters
    ----------
    access : Access
        Who may ask for what.
    listener : socket
        Listens where `access` says.
    motion : ShownMotion
        What is shown.
    ring, control : Ring, ControlBlock
        Where it is read.
    parent : int
        Process id of the program.
    """
    leave_terminal()
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(MOST_DESCRIPTORS, most), most))
    logging.getLogger("asyncio").setLevel(logging.CRITICAL)  # failed requests of others are no news
    picture = MotionPicture(motion, ring, control)
    asyncio.run(_serve(access, listener, picture, control, parent))


async def _serve(
    access: Access,
    listener: socket.socket,
    picture: MotionPicture,
    control: ControlBlock,
    parent: int,
) -> None:
    loop = asyncio.get_running_loop()
    loop.set_exception_handler(lambda loop, context: None)
    live = LiveServer(access, lambda: control.program.request_stop(StopCode.STOP_BUTTON))
    tls = access.tls()
    timeouts: dict[str, Any] = {}
    if tls is not None:
        patience_s = REQUEST_PATIENCE_S
        timeouts = {"ssl_handshake_timeout": patience_s, "ssl_shutdown_timeout": patience_s}
    server = await loop.create_server(
        live.protocol, sock=listener, backlog=BACKLOG, ssl=tls, **timeouts
    )
    while True:
        over = control.task_gone or os.getppid() != parent
        if live.streams or not live.latest or over:
            live.publish(picture.document())
        if over:
            break
        await asyncio.sleep(PERIOD_S)
    server.close()
    live.close()
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(LAST_WORDS_S):
            while live.streams or live.waiting:
                await asyncio.sleep(0.01)
