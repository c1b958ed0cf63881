"""`serve_cells`: the service as a process: its sockets, its loop, its end."""

from __future__ import annotations

import asyncio
import contextlib
import resource
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from fastapi import APIRouter

from config.errors import ConfigError, LockedError
from config.process.file_locks import held_file
from config.process.own_process import keep_from_collections
from config.process.termination import ending_signals
from rid_daq.live.live_page import listen_on
from rid_daq.service.api.admission import Admission
from rid_daq.service.api.app import make_api
from rid_daq.service.doorkeeper import Doorkeeper
from rid_daq.service.front.front_link import FrontLink
from rid_daq.service.logs import LOG
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.service import CellService
from rid_daq.service.sockets import local_listener
from rid_daq.service.stop.stop_entrance import StopEntrance
from rid_daq.service.store.state_folder import open_state_folder
from rid_daq.session.ownership import owned
from rid_daq.web.access import Access
from rid_daq.web.asgi_server import AsgiServer
from rid_daq.web.door import Limits
from rid_daq.web.guard import PLOT_POLICY, Guard

LIMITS: Final = Limits(
    waiting=1024,
    answering=128,
    streams=64,
    streams_of_one=8,
    message_bytes=8 << 10,
    stream_bytes=64 << 10,
    stream_bytes_s=32 << 10,
)
DESCRIPTORS: Final = 4096
"""Open files that the service asks the system for: a thousand slow clients must not take all."""


def serve_cells(
    cells: Sequence[str],
    folder: Path,
    access: Access,
    pace: float,
    pages: Sequence[APIRouter],
    ready: Callable[[str, Path], None],
) -> None:
    """Serve cells until this process is told to end; then nothing moves any more.

    Args:
        cells: Bundled names or cell files.
        folder: Folder of runs, motions and models.
        access: Where pages are served, and by which certificate.
        pace: Times real time at which simulated cells run.
        pages: Routes beside the API.
        ready: Told the address to open in a browser, and the socket for programs.

    Raises:
        ConfigError: A cell file is wrong, or an address cannot be served at.
        LockedError: Another service has one of the cells, or this folder.
        RecordingError: What the service keeps cannot be read or written.
    """
    folder = folder.resolve()
    if not folder.is_dir():
        raise ConfigError(f"{folder}: is no folder; make it first", code="RID-FILE-NOT-FOLDER")
    served = [ServedCell(reference, pace) for reference in cells]
    with contextlib.ExitStack() as stack:
        stack.enter_context(_only_one(folder))
        for cell in served:
            stack.enter_context(owned(cell.loaded.config))
        listener = stack.enter_context(listen_on(access))
        access = replace(access, port=listener.getsockname()[1])
        local, address = stack.enter_context(local_listener(folder))
        service = CellService(folder, served)
        secure = access.certificate is not None
        doorkeeper = Doorkeeper(service.tokens, access.port, secure=secure)
        app = make_api(service, doorkeeper, pages)
        server = AsgiServer(
            Guard(app, access, PLOT_POLICY),
            None,  # the process in front encrypts
            LIMITS,
            Admission(StopEntrance(app.state.stop_desk, access), doorkeeper, access),
        )
        link = replace(access, token=doorkeeper.link_secret).url

        async def serve() -> None:
            until = asyncio.Event()
            loop = asyncio.get_running_loop()
            for number in ending_signals():
                loop.add_signal_handler(number, until.set)
            ready(link, address)
            LOG.info("serving %s", ", ".join(service.cells))
            over = asyncio.Event()
            serving = asyncio.create_task(server.serve([], over))
            front = FrontLink(service, server, access, [listener, local])
            fronting = asyncio.create_task(front.run())
            try:
                await service.run(until)
            finally:
                over.set()
                await serving
                fronting.cancel()
                await asyncio.gather(fronting, return_exceptions=True)
            LOG.info("ended")

        access.tls()  # refused here, before anything begins
        _allow_descriptors()
        keep_from_collections()
        asyncio.run(serve())


def _allow_descriptors() -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = DESCRIPTORS if hard == resource.RLIM_INFINITY else min(DESCRIPTORS, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


@contextlib.contextmanager
def _only_one(folder: Path) -> Iterator[None]:
    state = open_state_folder(folder)
    try:
        with held_file(state / "lock"):
            yield
    except BlockingIOError:
        raise LockedError(
            f"{folder}: another service works in this folder", code="RID-CELL-BUSY"
        ) from None
