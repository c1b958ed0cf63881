"""Attackers of a service; each is a separate process that ends with the benchmark.

They represent other computers. Their processes have a low priority, so that they slow the service
down by their requests only and not by their own work.
"""

from __future__ import annotations

import contextlib
import http.client
import os
import sqlite3
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from websockets.exceptions import WebSocketException
from websockets.sync.client import ClientConnection, connect

from benchmarks.service import crowd

BODY: Final = b'{"kind": "check", "request": {"a": [' + b"[]," * 5_500_000 + b"[]]}}"
SENDERS: Final = 4
SOCKETS: Final = 40
NOISY: Final = 12
READERS: Final = 8
NONSENSE: Final = '{"job": "' + "x" * 2000 + '"}'
SLOW: Final = ("/api/v1/runs", "/api/v1/files", "/api/v1/openapi.json", "/metrics", "/api/v1/jobs")


@dataclass(frozen=True)
class Target:
    """A service that is attacked.

    Attributes:
        port: TCP port of the service.
        cell: Name of one of its cells.
        viewer: Secret of a viewer's token.
        database: File of its database.
    """

    port: int
    cell: str
    viewer: str
    database: Path


def send_bodies(target: Target) -> None:
    """Keep sending requests with bodies of 17 MB, without a token."""

    def send() -> None:
        line = http.client.HTTPConnection("127.0.0.1", target.port, timeout=30.0)
        with contextlib.suppress(OSError, http.client.HTTPException):
            headers = {"X-Rid-Daq": "1", "Content-Type": "application/json"}
            line.request("POST", f"/api/v1/cells/{target.cell}/jobs", BODY, headers)
            line.getresponse().read()
        line.close()
        time.sleep(0.05)

    _for_ever(send, SENDERS)


def take_sockets(target: Target) -> None:
    """Open as many WebSockets as possible with one token; send invalid data over a dozen."""
    shown = {"Authorization": f"Bearer {target.viewer}"}
    address = f"ws://127.0.0.1:{target.port}/api/v1/ws"

    def open_socket() -> ClientConnection:
        return connect(address, additional_headers=shown, open_timeout=30.0, max_size=None)

    def hold() -> None:
        with contextlib.suppress(OSError, WebSocketException), open_socket() as line:
            for _ in line:
                pass
        time.sleep(0.2)

    def disturb() -> None:
        with contextlib.suppress(OSError, WebSocketException), open_socket() as line:
            while True:
                line.send(NONSENSE)
        time.sleep(0.05)

    for _ in range(SOCKETS - NOISY):
        threading.Thread(target=_repeat, args=(hold,), daemon=True).start()
    _for_ever(disturb, NOISY)


def send_slow_requests(target: Target) -> None:
    """Send many slow requests at the same time, with a viewer's token."""
    shown = {"Authorization": f"Bearer {target.viewer}"}

    def ask() -> None:
        for path in SLOW:
            line = http.client.HTTPConnection("127.0.0.1", target.port, timeout=60.0)
            with contextlib.suppress(OSError, http.client.HTTPException):
                line.request("GET", path, headers=shown)
                line.getresponse().read()
            line.close()

    _for_ever(ask, READERS)


def hold_database(target: Target) -> None:
    """Lock the service's database, as another program might."""
    with contextlib.closing(sqlite3.connect(target.database, timeout=60.0)) as base:
        base.execute("BEGIN EXCLUSIVE")
        while True:
            time.sleep(60.0)


def crawl(target: Target) -> None:
    """Act as a thousand slow clients."""
    crowd(target.port)


ATTACKS: Final[dict[str, Callable[[Target], None]]] = {
    "bodies of 17 MB without a token": send_bodies,
    "40 WebSockets of one viewer, 12 of which send invalid messages": take_sockets,
    "slow requests of one viewer": send_slow_requests,
    "the database locked": hold_database,
    "a thousand slow clients": crawl,
}


def attack(name: str, target: Target) -> None:
    """Run one attacker, as the main function of its process."""
    os.nice(10)
    ATTACKS[name](target)


def _for_ever(work: Callable[[], None], threads: int) -> None:
    for _ in range(threads - 1):
        threading.Thread(target=_repeat, args=(work,), daemon=True).start()
    _repeat(work)


def _repeat(work: Callable[[], None]) -> None:
    while True:
        work()
