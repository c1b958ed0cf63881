"""The process that serves the live page; it looks on, and may die or hang without harm."""

from __future__ import annotations

import asyncio
import logging
import os
import resource
import socket

from acquisition.supervision.stop_reason import StopCode
from acquisition.task.control_block import ControlBlock
from acquisition.task.ring import Ring
from config.process.own_process import keep_from_collections
from config.process.termination import leave_terminal
from rid_daq.live.live_app import live_app
from rid_daq.live.picture import MotionPicture, ShownMotion
from rid_daq.web.access import Access
from rid_daq.web.asgi_server import AsgiServer
from rid_daq.web.door import Limits
from rid_daq.web.feed import Feed

PERIOD_S = 0.05
MOST_DESCRIPTORS = 256
LIMITS = Limits(body_bytes=1024)


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

    Args:
        access: Who may ask for what.
        listener: Listens where `access` says.
        motion: What is shown.
        ring, control: Where it is read.
        parent: Process id of the program.
    """
    leave_terminal()
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(MOST_DESCRIPTORS, most), most))
    logging.getLogger("asyncio").setLevel(logging.CRITICAL)  # failed requests of others are no news
    picture = MotionPicture(motion, ring, control)
    keep_from_collections()
    asyncio.run(_serve(access, listener, picture, control, parent))


async def _serve(
    access: Access,
    listener: socket.socket,
    picture: MotionPicture,
    control: ControlBlock,
    parent: int,
) -> None:
    asyncio.get_running_loop().set_exception_handler(lambda loop, context: None)
    feed, until = Feed(), asyncio.Event()
    app = live_app(access, feed, lambda: control.program.request_stop(StopCode.STOP_BUTTON))
    server = AsgiServer(app, access.tls(), LIMITS)
    serving = asyncio.create_task(server.serve([listener], until))
    feed.show(picture.document())
    while not (serving.done() or control.task_gone or os.getppid() != parent):
        if feed.viewers:
            feed.show(picture.document())
        await asyncio.wait([serving], timeout=PERIOD_S)
    feed.show(picture.document())
    feed.end()
    until.set()
    await serving
