"""`FrontLink`: the service's end of the process in front: starts it, tells it, takes over."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import time
from collections.abc import Sequence
from itertools import islice
from typing import Final

from config.process.own_process import own_python
from rid_daq.service.front.wire import Wire
from rid_daq.service.logs import LOG
from rid_daq.service.service import CellService
from rid_daq.service.stop.stop_answer import ALL
from rid_daq.web.access import Access
from rid_daq.web.asgi_server import AsgiServer
from rid_daq.web.reception import Peer

_AT_ONCE: Final = 500
_PAUSE_S: Final = 0.2
_END_S: Final = 3.0


class FrontLink:
    """Keeps a process in front of the service for as long as it serves.

    Args:
        service: Its cells are stopped.
        server: Adopts the connections.
        access: Where pages are served.
        listeners: They listen already.
    """

    def __init__(
        self,
        service: CellService,
        server: AsgiServer,
        access: Access,
        listeners: Sequence[socket.socket],
    ) -> None:
        self._service = service
        self._server = server
        self._access = access
        self._listeners = listeners
        self._wire: Wire | None = None
        self._jobs: dict[str, int] = {}

    async def run(self) -> None:
        """Have the process, and start another one if it ends; until this task is cancelled."""
        self._service.tokens.issued_to = self._send_issued
        self._service.workshop.changed = self._send_jobs
        while True:
            began_s = time.monotonic()
            await self._have_one()
            LOG.error("the process that answers STOP has ended: another one is started")
            if time.monotonic() - began_s < 1.0:
                await asyncio.sleep(_PAUSE_S)

    async def _have_one(self) -> None:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        descriptors = [listener.fileno() for listener in self._listeners]
        certificate = self._access.certificate
        told = {
            "wire": theirs.fileno(),
            "listeners": descriptors,
            "address": self._access.address,
            "port": self._access.port,
            "certificate": None if certificate is None else str(certificate.resolve()),
            "cells": list(self._service.cells),
        }
        over, wire = asyncio.Event(), Wire(ours)
        with theirs:
            process = await asyncio.create_subprocess_exec(
                *own_python("rid_daq.service.front", json.dumps(told)),
                pass_fds=(theirs.fileno(), *descriptors),
                start_new_session=True,
            )
        self._wire = wire
        wire.begin(self._received, over.set)
        issued = iter(self._service.tokens.issued())
        while hashes := list(islice(issued, _AT_ONCE)):
            while not wire.send({"issued": hashes}):
                await asyncio.sleep(0.01)
        wire.send({"jobs": self._jobs})
        try:
            await over.wait()
        finally:
            self._wire = None
            wire.close()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(process.wait(), _END_S)
            if process.returncode is None:
                process.kill()
                await process.wait()

    def _send_issued(self, key: str) -> None:
        if self._wire is not None:
            self._wire.send({"issued": [key]})

    def _send_jobs(self, jobs: dict[str, int]) -> None:
        self._jobs = jobs
        if self._wire is not None:
            self._wire.send({"jobs": jobs})

    def _received(self, document: dict[str, object], data: bytes, descriptor: int | None) -> None:
        if descriptor is not None:
            line = socket.socket(fileno=descriptor)
            peer = Peer(bool(document["local"]), str(document["address"]))
            self._server.adopt(line, peer, data)
        elif "stop" in document:
            self._note_stop(str(document["stop"]), str(document["who"]))

    def _note_stop(self, target: str, key: str) -> None:
        """Do what follows a stop that was passed on already: its reason, and the note."""
        token = self._service.tokens.of_hash(key)
        who = "somebody" if not key else "somebody with an old token"
        if token is not None:
            who = token.name
        for cell in self._service.cells if target == ALL else (target,):
            try:
                self._service.stop(cell, who)
            except Exception:
                LOG.exception("cell %s: the note of the stop by %s went wrong", cell, who)
