"""`Feed`: states and events for viewers. A slow viewer misses states, but no events."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncGenerator, Sequence

MOST_EVENTS = 256


class Feed:
    """Sends what is published to every viewer at the viewer's own speed; for one thread.

    A picture replaces an earlier picture of the same subject that a viewer has not received yet.
    Events are queued for every viewer. A viewer whose queue is too long is disconnected, so that it
    knows that events are missing.

    Args:
        most_events: Maximum length of a viewer's queue of events.
    """

    def __init__(self, most_events: int = MOST_EVENTS) -> None:
        self._most_events = most_events
        self._viewers: set[_Viewer] = set()
        self._pictures: dict[str, bytes] = {}
        self._over = False

    @property
    def viewers(self) -> int:
        """Number of viewers."""
        return len(self._viewers)

    def publish_picture(self, picture: bytes, of: str = "") -> None:
        """Publish the present state of a subject (a picture); it replaces the previous one."""
        self._pictures[of] = picture
        for viewer in self._viewers:
            viewer.pictures[of] = picture
            viewer.wake.set()

    def forget_picture(self, of: str) -> None:
        """Delete the newest picture of a subject; later viewers do not receive it."""
        self._pictures.pop(of, None)

    def publish_event(self, event: bytes) -> None:
        """Publish an event."""
        for viewer in self._viewers:
            viewer.events.append(event)
            viewer.over = viewer.over or len(viewer.events) > self._most_events
            viewer.wake.set()

    def end(self) -> None:
        """End the feed; viewers still receive their last pictures and all queued events."""
        self._over = True
        for viewer in self._viewers:
            viewer.over = True
            viewer.wake.set()

    async def view(
        self, first: Sequence[bytes] = (), pause_s: float = 0.0
    ) -> AsyncGenerator[bytes]:
        """Yield the messages for one viewer: the present pictures, then all that is published.

        Waiting events come before waiting pictures.

        Args:
            first: Events that only this viewer receives, before all others.
            pause_s: Minimum time between two checks for new messages [s].
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
    """Queued messages of one viewer."""

    def __init__(self, events: Sequence[bytes], pictures: dict[str, bytes], over: bool) -> None:
        self.events = deque(events)
        self.pictures = dict(pictures)
        self.over = over
        self.wake = asyncio.Event()
