"""`Viewers`: who looks on: every one gets all events, and of the samples the newest."""

from __future__ import annotations

import asyncio
from collections import deque
from typing import Final

MOST_WAITING: Final = 2000


class Viewer:
    """One who looks on.

    Attributes
    ----------
    too_slow : bool
        Whether so many events wait that the connection is given up.
    """

    too_slow = False

    def __init__(self) -> None:
        self._events: deque[str] = deque()
        self._samples: dict[str, str] = {}
        self._new = asyncio.Event()

    def tell(self, event: str) -> None:
        """Have an event sent, one text of JSON."""
        if len(self._events) >= MOST_WAITING:
            self.too_slow = True
        else:
            self._events.append(event)
        self._new.set()

    def show(self, cell: str, samples: str) -> None:
        """Have the newest samples of a cell sent; older ones that wait are left out."""
        self._samples[cell] = samples
        self._new.set()

    async def next(self) -> list[str]:
        """Return what is to be sent, as soon as there is something."""
        await self._new.wait()
        self._new.clear()
        sent = [*self._events, *self._samples.values()]
        self._events.clear()
        self._samples.clear()
        return sent


class Viewers:
    """All who look on."""

    def __init__(self) -> None:
        self._all: set[Viewer] = set()

    def __len__(self) -> int:
        return len(self._all)

    def join(self) -> Viewer:
        """Return a new viewer."""
        viewer = Viewer()
        self._all.add(viewer)
        return viewer

    def leave(self, viewer: Viewer) -> None:
        """Forget a viewer."""
        self._all.discard(viewer)

    def tell(self, event: str) -> None:
        """Tell every viewer an event."""
        for viewer in self._all:
            viewer.tell(event)

    def show(self, cell: str, samples: str) -> None:
        """Show every viewer the newest samples of a cell."""
        for viewer in self._all:
            viewer.show(cell, samples)
