"""Process of the live page; its failure does not affect the motion."""

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
from rid_daq.web.connection_groups import Limits
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

    The process ends with the motion. It writes nothing but the stop request into shared memory.

    Args:
        access: Address and secrets of the page.
        listener: Listening socket.
        motion: Description of the motion.
        ring, control: Shared memory of the motion.
        parent: Process id of the program.
    """
    leave_terminal()
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(MOST_DESCRIPTORS, most), most))
    logging.getLogger("asyncio").setLevel(
        logging.CRITICAL
    )  # failed requests of clients are not logged
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
    feed.publish_picture(picture.document())
    while not (serving.done() or control.task_gone or os.getppid() != parent):
        if feed.viewers:
            feed.publish_picture(picture.document())
        await asyncio.wait([serving], timeout=PERIOD_S)
    feed.publish_picture(picture.document())
    feed.end()
    until.set()
    await serving
