"""`Feed`: what viewers are shown; a slow one misses pictures, and no event."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncGenerator, Sequence

MOST_EVENTS = 256


class Feed:
    """Hands what is published to every viewer, each at its own pace; one thread's.

    A picture replaces the one before it of the same subject that a viewer has not taken yet. An
    event is kept for every viewer; one for whom too many wait is ended, so that it knows that it
    has missed something.

    Args:
        most_events: How many events may wait for a viewer.
    """

    def __init__(self, most_events: int = MOST_EVENTS) -> None:
        self._most_events = most_events
        self._viewers: set[_Viewer] = set()
        self._pictures: dict[str, bytes] = {}
        self._over = False

    @property
    def viewers(self) -> int:
        """How many there are."""
        return len(self._viewers)

    def show(self, picture: bytes, of: str = "") -> None:
        """Publish a picture of how a subject is now."""
        self._pictures[of] = picture
        for viewer in self._viewers:
            viewer.pictures[of] = picture
            viewer.wake.set()

    def forget(self, of: str) -> None:
        """Show the newest picture of a subject to nobody who comes later."""
        self._pictures.pop(of, None)

    def tell(self, event: bytes) -> None:
        """Publish what has happened."""
        for viewer in self._viewers:
            viewer.events.append(event)
            viewer.over = viewer.over or len(viewer.events) > self._most_events
            viewer.wake.set()

    def end(self) -> None:
        """Say that nothing follows; who is behind still gets the last pictures and all events."""
        self._over = True
        for viewer in self._viewers:
            viewer.over = True
            viewer.wake.set()

    async def view(
        self, first: Sequence[bytes] = (), pause_s: float = 0.0
    ) -> AsyncGenerator[bytes]:
        """Yield what one viewer is shown, from the last pictures on; events before pictures.

        Args:
            first: Events that this viewer alone is told at first.
            pause_s: The least time between two looks at what is new [s].
        """
        viewer = _Viewer(first, self._pictures, self._over)
        self._viewers.add(viewer)
        try:
            while True:
                viewer.wake.clear()
                while viewer.events:
                    if len(viewer.events) > self._most_events:
                        return
                    yield viewer.events.popleft()
                pictures, viewer.pictures = viewer.pictures, {}
                for picture in pictures.values():
                    yield picture
                if not viewer.wake.is_set():
                    if viewer.over:
                        return
                    await viewer.wake.wait()
                if pause_s:
                    await asyncio.sleep(pause_s)
        finally:
            self._viewers.discard(viewer)


class _Viewer:
    """What waits for one viewer."""

    def __init__(self, events: Sequence[bytes], pictures: dict[str, bytes], over: bool) -> None:
        self.events = deque(events)
        self.pictures = dict(pictures)
        self.over = over
        self.wake = asyncio.Event()
