"""`FairScheduler`: limits the requests that are processed at once, fairly among their owners."""

from __future__ import annotations

import asyncio
import contextlib
from collections import Counter, OrderedDict, deque
from typing import Final

AT_ONCE: Final = 24
OF_ONE: Final = 4
WAITING_OF_ONE: Final = 24


class QueueFullError(Exception):
    """Too many requests of one owner wait already."""


class FairScheduler:
    """Grants slots to the waiting requests of all owners in rotation; for one event loop.

    Args:
        at_once, of_one: Number of slots, of all owners and of one owner.
        waiting_of_one: Number of requests of one owner that may wait.
    """

    def __init__(
        self, at_once: int = AT_ONCE, of_one: int = OF_ONE, waiting_of_one: int = WAITING_OF_ONE
    ) -> None:
        self._at_once = at_once
        self._of_one = of_one
        self._waiting_of_one = waiting_of_one
        self._taken: Counter[str] = Counter()
        self._waiting: OrderedDict[str, deque[asyncio.Future[None]]] = OrderedDict()

    async def acquire(self, key: str) -> Slot:
        """Wait for a slot.

        Raises:
            QueueFullError: Too many requests of this owner wait already.
        """
        if self._is_free(key) and key not in self._waiting:
            self._taken[key] += 1
            return Slot(self, key)
        queue = self._waiting.setdefault(key, deque())
        if len(queue) >= self._waiting_of_one:
            raise QueueFullError
        ready: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        queue.append(ready)
        try:
            await ready
        except asyncio.CancelledError:
            if ready.done() and not ready.cancelled():
                self.release(key)
            else:
                with contextlib.suppress(ValueError):
                    queue.remove(ready)
                if not queue and self._waiting.get(key) is queue:
                    del self._waiting[key]
            raise
        return Slot(self, key)

    def release(self, key: str) -> None:
        """Release a slot; the next owner in the rotation receives it."""
        self._taken[key] -= 1
        if not self._taken[key]:
            del self._taken[key]
        for waiting in tuple(self._waiting):
            while waiting in self._waiting and self._is_free(waiting):
                queue = self._waiting.pop(waiting)
                ready = queue.popleft()
                if queue:
                    self._waiting[waiting] = queue  # this owner is now the last in the rotation
                if not ready.done():
                    self._taken[waiting] += 1
                    ready.set_result(None)
                    break

    def _is_free(self, key: str) -> bool:
        return self._taken.total() < self._at_once and self._taken[key] < self._of_one


class Slot:
    """Slot of one request."""

    def __init__(self, scheduler: FairScheduler, key: str) -> None:
        self._scheduler: FairScheduler | None = scheduler
        self._key = key

    def release(self) -> None:
        """Release the slot; a second call does nothing."""
        if self._scheduler is not None:
            self._scheduler.release(self._key)
            self._scheduler = None
