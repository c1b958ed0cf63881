"""`Editors`: clients that have a file open for editing now."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from rid_daq.service.records import Identity, Record

PRESENT_S: Final = 15.0
"""Time after its last request for which a page counts as open [s]."""

MOST: Final = 200
"""Largest number of open editors in the list."""


class Editor(Record):
    """A page on which a file is open.

    Attributes:
        who: Name of the client.
        since_s: Time when the file was opened [s since 1970].
        has_changes: True if the page has changes that are not saved.
    """

    who: str
    since_s: float
    has_changes: bool


class Editors:
    """Open editors of all files; a page repeats its entry while it is open.

    Args:
        now_s: Monotonic clock [s].
    """

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._open: dict[tuple[Path, str], tuple[float, Editor]] = {}

    def note(self, path: Path, tab: str, who: Identity, *, has_changes: bool) -> tuple[Editor, ...]:
        """Note that a page has a file open, and return the other pages with this file.

        Args:
            path: The file.
            tab: Random name of the page.
            who: Client of the page.
            has_changes: True if the page has changes that are not saved.
        """
        now_s = self._now_s()
        self._open = {
            key: (seen_s, each)
            for key, (seen_s, each) in self._open.items()
            if now_s - seen_s < PRESENT_S
        }
        before = self._open.get((path, tab))
        since_s = time.time() if before is None else before[1].since_s
        if before is not None or len(self._open) < MOST:
            own = Editor(who=who.name, since_s=since_s, has_changes=has_changes)
            self._open[path, tab] = (now_s, own)
        return tuple(
            each for (file, other), (_, each) in self._open.items() if file == path and other != tab
        )

    def forget(self, path: Path, tab: str) -> None:
        """Remove the entry of a page that is being closed."""
        self._open.pop((path, tab), None)
