"""`serve_cells`: runs the service in this process: sockets, event loop and shutdown."""

from __future__ import annotations

import asyncio
import contextlib
import resource
import threading
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
from rid_daq.service.api.run_index import run_index
from rid_daq.service.authenticator import Authenticator
from rid_daq.service.front.front_link import FrontLink
from rid_daq.service.logs import LOG
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.service import CellService
from rid_daq.service.sockets import local_listener
from rid_daq.service.stop.stop_endpoint import StopEndpoint
from rid_daq.service.store.state_folder import open_state_folder
from rid_daq.session.ownership import own_cell
from rid_daq.web.access import Access
from rid_daq.web.asgi_server import AsgiServer
from rid_daq.web.connection_groups import Limits
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
"""Limit of open files that the service requests, enough for a thousand slow clients."""


def serve_cells(
    cells: Sequence[str],
    folder: Path,
    access: Access,
    pace: float,
    pages: Sequence[APIRouter],
    ready: Callable[[str, Path], None],
) -> None:
    """Serve cells until this process receives a termination signal; then stop all motions.

    Args:
        cells: Bundled names or cell files.
        folder: Folder of runs, motions and models.
        access: Address of the pages, and their TLS certificate.
        pace: Speed of simulated cells, as a multiple of real time.
        pages: Routes in addition to the API.
        ready: Function that is called with the address to open in a browser and the socket for
            programs.

    Raises:
        ConfigError: A cell file is invalid, or the service cannot listen on the address.
        LockedError: Another service owns one of the cells, or this folder.
        RecordingError: The service's saved state cannot be read or written.
    """
    folder = folder.resolve()
    if not folder.is_dir():
        raise ConfigError(f"{folder}: is not a folder: create it first", code="RID-FILE-NOT-FOLDER")
    served = [ServedCell(reference, pace) for reference in cells]
    with contextlib.ExitStack() as stack:
        stack.enter_context(_lock_folder(folder))
        for cell in served:
            stack.enter_context(own_cell(cell.loaded.config))
        listener = stack.enter_context(listen_on(access))
        access = replace(access, port=listener.getsockname()[1])
        local, address = stack.enter_context(local_listener(folder))
        service = CellService(folder, served)
        secure = access.certificate is not None
        authenticator = Authenticator(service.tokens, access.port, secure=secure)
        app = make_api(service, authenticator, pages)
        server = AsgiServer(
            Guard(app, access, PLOT_POLICY),
            None,  # no TLS here: the front process encrypts
            LIMITS,
            Admission(StopEndpoint(app.state.stop_handler, access), authenticator, access),
        )
        link = replace(access, token=authenticator.link_secret).url

        async def serve() -> None:
            until = asyncio.Event()
            loop = asyncio.get_running_loop()
            for number in ending_signals():
                loop.add_signal_handler(number, until.set)
            ready(link, address)
            LOG.info("serving %s", ", ".join(service.cells))
            threading.Thread(
                target=run_index(service.runs).newest_first, name="runs", daemon=True
            ).start()  # the first reading of many runs takes long
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

        access.tls()  # raises an error if the certificate is invalid, before anything starts
        _raise_descriptor_limit()
        keep_from_collections()
        asyncio.run(serve())


def _raise_descriptor_limit() -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = DESCRIPTORS if hard == resource.RLIM_INFINITY else min(DESCRIPTORS, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


@contextlib.contextmanager
def _lock_folder(folder: Path) -> Iterator[None]:
    state = open_state_folder(folder)
    try:
        with held_file(state / "lock"):
            yield
    except BlockingIOError:
        raise LockedError(
            f"{folder}: another service uses this folder: end it, or choose another folder",
            code="RID-CELL-BUSY",
        ) from None
