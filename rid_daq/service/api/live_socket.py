"""WebSocket of a viewer: it sends changes, events and signals, and receives held keys."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from collections.abc import Callable
from functools import partial
from http import HTTPStatus
from typing import Final

from fastapi import APIRouter, WebSocket, WebSocketDisconnect

from config.errors import LockedError, RidDaqError
from rid_daq.service.api.challenges import Challenges
from rid_daq.service.api.context import is_local
from rid_daq.service.api.signal_sender import SignalSender
from rid_daq.service.authenticator import Authenticator
from rid_daq.service.logs import LOG
from rid_daq.service.records import Identity, Role
from rid_daq.service.refusals import UnknownError
from rid_daq.service.service import CellService
from rid_daq.service.stop.stop_socket import BEAT, BEAT_S, answer_to_stop
from rid_daq.web.request_secrets import SOCKET_PROTOCOL

router = APIRouter()

SAMPLES_S: Final = 0.05
"""Minimum time between two messages to a viewer [s]: at most twenty per second."""

KNOWN_S: Final = 1.0
"""Period of the check of a viewer's token [s]."""

MOST_MESSAGES: Final = 200
MESSAGES_PER_S: Final = 60
"""Limits of a viewer's messages: a burst after a stalled link, and a rate [1/s]."""

MOST_MISTAKES: Final = 10
_KEYS: Final = ("stop", "job", "held", "tapped", "signals")

IDLE_S: Final = 0.1
"""Time between two checks for jobs that require a held key, while there is no such job [s]."""

MOST_VIEWERS: Final = 64
TOO_MANY: Final = 1013
NO_TOKEN: Final = 1008
TOO_SLOW: Final = 1013


@router.websocket("/api/v1/ws")
async def stream_to_viewer(socket: WebSocket) -> None:
    """Send a viewer all changes and events until it disconnects or is too slow.

    Messages to the viewer have a `type`: `cell`, `job`, `event`, `samples`, `beat`, `stopped`, and
    `challenge` while a job requires a held key. The `number` of an `event` counts the events of its
    job from 0: a viewer that misses one requests it from `/api/v1/jobs/JOB/events`. An operator
    holds a key by answering each challenge with `{"job": ID, "lease": KEY, "held": "+",
    "sequence": 12, "challenge": VALUE}`. `"held": ""` means that the key was released, `tapped`
    that a key was tapped. The viewer may also send `{"stop": CELL, "number": N}`.
    After `{"signals": CELL}`, the viewer also receives the cell's live signals as binary messages
    (`SignalView`).
    """
    service: CellService = socket.app.state.service
    authenticator: Authenticator = socket.app.state.authenticator
    known = partial(authenticator.find_identity, socket.headers, local=is_local(socket))
    who = known()
    if who is None:
        await socket.close(NO_TOKEN, HTTPStatus.UNAUTHORIZED.phrase)
        return
    if service.feed.viewers >= MOST_VIEWERS:
        await socket.close(TOO_MANY, "too many viewers")
        return
    offered = socket.scope.get("subprotocols", ())
    await socket.accept(SOCKET_PROTOCOL if SOCKET_PROTOCOL in offered else None)
    sender = _Sender(socket)
    challenges = Challenges()
    signals = SignalSender(sender.send_bytes, service.live.signals)
    beside = [
        asyncio.create_task(signals.run()),
        asyncio.create_task(_send_feed(sender, service)),
        asyncio.create_task(_close_when_revoked(socket, known)),
        asyncio.create_task(_send_beats(sender)),
    ]
    if who.role.includes(Role.OPERATOR):
        beside.append(asyncio.create_task(_send_challenges(sender, service, challenges)))
    try:
        await _receive(sender, service, challenges, signals, known)
    except (WebSocketDisconnect, RuntimeError, OSError):
        LOG.debug("a viewer has disconnected")
    finally:
        for task in beside:
            task.cancel()
            with contextlib.suppress(
                asyncio.CancelledError, WebSocketDisconnect, RuntimeError, OSError
            ):
                await task


class _Sender:
    """Sends messages to one viewer, and stores the time of the last message."""

    def __init__(self, socket: WebSocket) -> None:
        self.socket = socket
        self.last_s = time.monotonic()

    async def send(self, text: str) -> None:
        self.last_s = time.monotonic()
        await self.socket.send_text(text)

    async def send_bytes(self, data: bytes) -> None:
        self.last_s = time.monotonic()
        await self.socket.send_bytes(data)


async def _send_beats(sender: _Sender) -> None:
    """Send a heartbeat to a viewer while no other message is sent."""
    while True:
        await asyncio.sleep(BEAT_S)
        if time.monotonic() - sender.last_s >= BEAT_S:
            await sender.send(BEAT.decode())


async def _send_feed(sender: _Sender, service: CellService) -> None:
    statuses = (service.status(cell) for cell in service.cells.values())
    first = [
        json.dumps({"type": "cell", "cell": status.model_dump(mode="json")}).encode()
        for status in statuses
    ]
    async with contextlib.aclosing(service.feed.view(first, SAMPLES_S)) as view:
        async for document in view:
            await sender.send(document.decode())
    await sender.socket.close(TOO_SLOW, "too slow: events would be lost")


async def _close_when_revoked(socket: WebSocket, known: Callable[[], Identity | None]) -> None:
    """Close the socket of a viewer whose token is revoked."""
    while known() is not None:
        await asyncio.sleep(KNOWN_S)
    await socket.close(NO_TOKEN, HTTPStatus.UNAUTHORIZED.phrase)


async def _send_challenges(sender: _Sender, service: CellService, challenges: Challenges) -> None:
    """Send challenges while a job requires a held key."""
    while True:
        jobs = service.jobs_wanting_keys()
        for job in jobs:
            await sender.send(json.dumps(challenges.issue(job)))
        await asyncio.sleep(challenges.pause_s if jobs else IDLE_S)


async def _receive(
    sender: _Sender,
    service: CellService,
    challenges: Challenges,
    signals: SignalSender,
    known: Callable[[], Identity | None],
) -> None:
    socket, budget = sender.socket, _Budget()
    while True:
        document = _parse_message(await socket.receive_text())
        if not budget.has_messages_left(is_message=document is not None):
            await socket.close(NO_TOKEN, "too many messages, or too many unknown ones")
            return
        if document is None:
            continue
        who = known()
        if isinstance(document.get("stop"), str):
            name = "a user with a revoked token" if who is None else who.name
            answer = answer_to_stop(socket.app.state.stop_handler, name, document)
            await sender.send(json.dumps(answer))
            continue
        if who is None:
            await socket.close(NO_TOKEN, HTTPStatus.UNAUTHORIZED.phrase)
            return
        if who.role.includes(Role.OPERATOR):
            with contextlib.suppress(RidDaqError):
                _forward_key(service, challenges, document)
        if "signals" in document:
            signals.request(document)


def _parse_message(text: str) -> dict[str, object] | None:
    """Return a viewer's message as a JSON object; None if no expected key has a text as value."""
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        return None
    is_message = isinstance(document, dict) and any(
        isinstance(document.get(key), str) for key in _KEYS
    )
    return document if is_message else None


class _Budget:
    """Number of messages that a viewer may still send; it increases every second."""

    def __init__(self) -> None:
        self._messages, self._mistakes = float(MOST_MESSAGES), MOST_MISTAKES
        self._at_s = time.monotonic()

    def has_messages_left(self, *, is_message: bool) -> bool:
        """Count a message, and return True if it is allowed."""
        now_s = time.monotonic()
        come = MESSAGES_PER_S * (now_s - self._at_s)
        self._messages, self._at_s = min(MOST_MESSAGES, self._messages + come) - 1.0, now_s
        self._mistakes -= not is_message
        return self._messages >= 0.0 and self._mistakes >= 0


def _forward_key(service: CellService, challenges: Challenges, document: dict[str, object]) -> None:
    """Forward a key message from the holder of the cell.

    Raises:
        LockedError: Another client holds the cell.
        UnknownError: There is no such job.
    """
    job = service.jobs.in_memory(str(document.get("job")))
    if job is None:
        raise UnknownError("this job is not running", code="RID-JOB-UNKNOWN")
    key = document.get("lease")
    if not isinstance(key, str):
        raise LockedError(
            "the message has no lease key: take the cell's lease first", code="RID-LEASE-NONE"
        )
    lease = service.leases.require(job.cell, key)
    message = challenges.parse_key_message(job.id, lease.id, document)
    if message is not None:
        service.forward_key(job.id, message)
