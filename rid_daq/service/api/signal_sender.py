"""`SignalSender`: sends the live signals of one cell to a viewer that has requested them."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
from collections.abc import Awaitable, Callable, Mapping
from typing import Final

from fastapi import WebSocketDisconnect

from rid_daq.service.signals.signal_history import SignalHistory
from rid_daq.service.signals.signal_view import SignalView

SIGNALS_S: Final = 0.1
"""Minimum time between two messages with live signals to a viewer [s]."""

OLDER_TURNS: Final = 3
"""Number of messages with new bins for each message with older ones: ten minutes take 6 s."""


class SignalSender:
    """Sends the live signals of at most one cell: the cell of the newest request.

    Args:
        send: Sends a binary message to the viewer.
        histories: Live signals by cell.
    """

    def __init__(
        self, send: Callable[[bytes], Awaitable[None]], histories: Mapping[str, SignalHistory]
    ) -> None:
        self._send = send
        self._histories = histories
        self._view: SignalView | None = None
        self._wanted = asyncio.Event()

    def request(self, document: Mapping[str, object]) -> None:
        """Process a request: `{"signals": CELL, "key": KEY, "known": N}`; an unknown cell ends it.

        `key` and `known` are those of the last message that the viewer received, if any.
        """
        cell, key, known = (document.get(name) for name in ("signals", "key", "known"))
        history = self._histories.get(str(cell))
        self._view = None
        if history is not None:
            is_known = isinstance(key, str) and type(known) is int
            arguments = (str(key), int(str(known))) if is_known else ()
            self._view = SignalView(str(cell), history, *arguments)
        self._wanted.set()

    async def run(self) -> None:
        """Send live signals until the task is cancelled."""
        with contextlib.suppress(WebSocketDisconnect, RuntimeError, OSError):
            await self._wanted.wait()
            for turn in itertools.count():
                view = self._view
                if view is not None:
                    await self._send_if_any(view.next_new())
                if view is not None and turn % OLDER_TURNS == 0:
                    await self._send_if_any(view.next_older())
                await asyncio.sleep(SIGNALS_S)

    async def _send_if_any(self, message: bytes | None) -> None:
        if message is not None:
            await self._send(message)
