"""`Turns`: requests that are worked on at once, shared fairly between those who ask."""

from __future__ import annotations

import asyncio
import contextlib
from collections import Counter, OrderedDict, deque
from collections.abc import AsyncIterator
from typing import Final

AT_ONCE: Final = 24
OF_ONE: Final = 4
WAITING_OF_ONE: Final = 24


class NoTurnError(Exception):
    """Too many requests of one owner wait already."""


class Turns:
    """Gives out turns in rotation between owners; one event loop's.

    Args:
        at_once, of_one: Turns at the same time, of all and of one owner.
        waiting_of_one: Requests of one owner that may wait.
    """

    def __init__(
        self, at_once: int = AT_ONCE, of_one: int = OF_ONE, waiting_of_one: int = WAITING_OF_ONE
    ) -> None:
        self._at_once = at_once
        self._of_one = of_one
        self._waiting_of_one = waiting_of_one
        self._taken: Counter[str] = Counter()
        self._waiting: OrderedDict[str, deque[asyncio.Future[None]]] = OrderedDict()

    async def take(self, key: str) -> Turn:
        """Wait for a turn.

        Raises:
            NoTurnError: Too many of this owner wait already.
        """
        if self._is_free(key) and key not in self._waiting:
            self._taken[key] += 1
            return Turn(self, key)
        queue = self._waiting.setdefault(key, deque())
        if len(queue) >= self._waiting_of_one:
            raise NoTurnError
        ready: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        queue.append(ready)
        try:
            await ready
        except asyncio.CancelledError:
            if ready.done() and not ready.cancelled():
                self.give_back(key)
            else:
                with contextlib.suppress(ValueError):
                    queue.remove(ready)
                if not queue and self._waiting.get(key) is queue:
                    del self._waiting[key]
            raise
        return Turn(self, key)

    @contextlib.asynccontextmanager
    async def of(self, key: str) -> AsyncIterator[Turn]:
        """Have a turn for as long as the `with` lasts, or until it is given back."""
        turn = await self.take(key)
        try:
            yield turn
        finally:
            turn.give_back()

    def give_back(self, key: str) -> None:
        """End a turn; the next owner in the rotation has it."""
        self._taken[key] -= 1
        if not self._taken[key]:
            del self._taken[key]
        for waiting in tuple(self._waiting):
            while waiting in self._waiting and self._is_free(waiting):
                queue = self._waiting.pop(waiting)
                ready = queue.popleft()
                if queue:
                    self._waiting[waiting] = queue  # at the end of the rotation
                if not ready.done():
                    self._taken[waiting] += 1
                    ready.set_result(None)
                    break

    def _is_free(self, key: str) -> bool:
        return self._taken.total() < self._at_once and self._taken[key] < self._of_one


class Turn:
    """One request's turn."""

    def __init__(self, turns: Turns, key: str) -> None:
        self._turns: Turns | None = turns
        self._key = key

    def give_back(self) -> None:
        """End it, once."""
        if self._turns is not None:
            self._turns.give_back(self._key)
            self._turns = None
