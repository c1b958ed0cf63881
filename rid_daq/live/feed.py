"""`Feed`: what viewers are shown; a slow one misses pictures, and no event."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncIterator

MOST_EVENTS = 256


class Feed:
    """Hands what is published to every viewer, each at its own pace; one thread's.

    A picture replaces the one before it that a viewer has not taken yet. An event is kept for every
    viewer; one for whom `MOST_EVENTS` wait is ended, so that it knows that it has missed something.
    """

    def __init__(self) -> None:
        self._viewers: set[_Viewer] = set()
        self._picture: bytes | None = None
        self._over = False

    @property
    def viewers(self) -> int:
        """How many there are."""
        return len(self._viewers)

    def show(self, picture: bytes) -> None:
        """Publish a picture of how things are now."""
        self._picture = picture
        for viewer in self._viewers:
            viewer.picture = picture
            viewer.wake.set()

    def tell(self, event: bytes) -> None:
        """Publish what has happened."""
        for viewer in self._viewers:
            viewer.events.append(event)
            viewer.over = viewer.over or len(viewer.events) > MOST_EVENTS
            viewer.wake.set()

    def end(self) -> None:
        """Say that nothing follows; who is behind still gets the last picture and all events."""
        self._over = True
        for viewer in self._viewers:
            viewer.over = True
            viewer.wake.set()

    async def view(self) -> AsyncIterator[bytes]:
        """Yield what one viewer is shown, from the last picture on; events before pictures."""
        viewer = _Viewer(self._picture, self._over)
        self._viewers.add(viewer)
        try:
            while True:
                viewer.wake.clear()
                while viewer.events:
                    if len(viewer.events) > MOST_EVENTS:
                        return
                    yield viewer.events.popleft()
                if viewer.picture is not None:
                    picture, viewer.picture = viewer.picture, None
                    yield picture
                elif viewer.over:
                    return
                else:
                    await viewer.wake.wait()
        finally:
            self._viewers.discard(viewer)


class _Viewer:
    """What waits for one viewer."""

    def __init__(self, picture: bytes | None, over: bool) -> None:
        self.picture = picture
        self.over = over
        self.events: deque[bytes] = deque()
        self.wake = asyncio.Event()
