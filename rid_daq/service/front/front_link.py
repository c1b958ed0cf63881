"""`FrontLink`: starts the front process, sends it data, and takes over its connections."""

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
from rid_daq.service.front.message_channel import MessageChannel
from rid_daq.service.logs import LOG
from rid_daq.service.service import CellService
from rid_daq.service.stop.stop_answer import ALL
from rid_daq.web.access import Access
from rid_daq.web.asgi_server import AsgiServer
from rid_daq.web.head_handler import Peer

_AT_ONCE: Final = 500
_PAUSE_S: Final = 0.2
_END_S: Final = 3.0


class FrontLink:
    """Keeps a front process running while the service serves.

    Args:
        service: Service whose cells the front process may stop.
        server: Web server that takes over the connections.
        access: Address and certificate of the pages.
        listeners: Listening sockets.
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
        self._channel: MessageChannel | None = None
        self._jobs: dict[str, int] = {}

    async def run(self) -> None:
        """Start the front process, and start a new one if it ends; until this task is cancelled."""
        self._service.tokens.issued_to = self._send_issued_secret
        self._service.job_runner.bus_owners_changed = self._send_jobs
        while True:
            began_s = time.monotonic()
            await self._run_front_process()
            LOG.error("the front process has ended; a new one is started")
            if time.monotonic() - began_s < 1.0:
                await asyncio.sleep(_PAUSE_S)

    async def _run_front_process(self) -> None:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        descriptors = [listener.fileno() for listener in self._listeners]
        certificate = self._access.certificate
        start = {
            "channel": theirs.fileno(),
            "listeners": descriptors,
            "address": self._access.address,
            "port": self._access.port,
            "certificate": None if certificate is None else str(certificate.resolve()),
            "cells": list(self._service.cells),
        }
        over, channel = asyncio.Event(), MessageChannel(ours)
        with theirs:
            process = await asyncio.create_subprocess_exec(
                *own_python("rid_daq.service.front", json.dumps(start)),
                pass_fds=(theirs.fileno(), *descriptors),
                start_new_session=True,
            )
        self._channel = channel
        channel.begin(self._process_message, over.set)
        issued = iter(self._service.tokens.issued())
        while hashes := list(islice(issued, _AT_ONCE)):
            while not channel.send({"issued": hashes}):
                await asyncio.sleep(0.01)
        channel.send({"jobs": self._jobs})
        try:
            await over.wait()
        finally:
            self._channel = None
            channel.close()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(process.wait(), _END_S)
            if process.returncode is None:
                process.kill()
                await process.wait()

    def _send_issued_secret(self, key: str) -> None:
        if self._channel is not None:
            self._channel.send({"issued": [key]})

    def _send_jobs(self, jobs: dict[str, int]) -> None:
        self._jobs = jobs
        if self._channel is not None:
            self._channel.send({"jobs": jobs})

    def _process_message(
        self, document: dict[str, object], data: bytes, descriptor: int | None
    ) -> None:
        if descriptor is not None:
            line = socket.socket(fileno=descriptor)
            peer = Peer(bool(document["local"]), str(document["address"]))
            self._server.adopt(line, peer, data)
        elif "stop" in document:
            self._record_stop(str(document["stop"]), str(document["who"]))

    def _record_stop(self, target: str, key: str) -> None:
        """Record a stop that the front process has executed: its reason, and the user action."""
        token = self._service.tokens.token_of_hash(key)
        who = "a user" if not key else "a user with a revoked token"
        if token is not None:
            who = token.name
        for cell in self._service.cells if target == ALL else (target,):
            try:
                self._service.stop(cell, who)
            except Exception:
                LOG.exception("cell %s: recording the stop by %s failed", cell, who)
