"""The moving line of a long step: title, bar, how much, time left, and how it goes."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console as RichConsole

BAR = (10, 24)  # columns at least, and at most
_TIME_LEFT = 8  # 99:59:59
_TAIL = 28  # columns that the tail is given before the bar grows
_BREAKS = re.compile(r"; |, | \(")


@dataclass(frozen=True)
class BarLine:
    """What one line of the display holds.

    Attributes:
        title: What is done.
        bar: Columns of the bar.
        tail: How it goes.
    """

    title: str
    bar: int
    tail: str


def bar_line(width: int, title: str, count: str, tail: str) -> BarLine:
    """Lay a line out so that bar, count and time left are never lost.

    Args:
        width: Columns of the terminal.
        title, count, tail: What is done, how much of it, and how it goes, most important first.
    """
    title = shortened(title, max(width // 4, 8))
    free = width - len(title) - len(count) - _TIME_LEFT - 4  # a column between each two
    least, most = BAR
    whole = _BREAKS.search(tail)
    first = len(tail) if whole is None else whole.start()  # of no use where it is cut
    bar = max(least, min(most, free - max(first, min(_TAIL, len(tail)))))
    return BarLine(title, bar, shortened(tail, free - bar))


def shortened(text: str, room: int) -> str:
    """Return the parts of a text that have room, from its beginning; parts end at `;`, `,`, `(`."""
    if len(text) <= room:
        return text
    ends = [found.start() for found in _BREAKS.finditer(text) if found.start() <= room]
    if ends:
        return text[: ends[-1]]
    return f"{text[: room - 1]}…" if room > 1 else ""


def format_count(number: float) -> str:
    """Return how much is done as a person reads it."""
    return f"{number:.0f}" if number >= 10 or number == int(number) else f"{number:.1f}"


class MovingBar:
    """What a step tells how far it is."""

    def __init__(
        self, title: str, total: float | None, unit: str, console: RichConsole | None = None
    ) -> None:
        from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
        from rich.progress import Progress as RichProgress

        self._title, self._unit, self._total = title, unit, total
        self._bar = BarColumn(bar_width=BAR[1])
        columns = (
            TextColumn("{task.description}", markup=False),
            self._bar,
            TextColumn("{task.fields[count]}", markup=False),
            TimeRemainingColumn(),
            TextColumn("{task.fields[tail]}", markup=False),
        )
        self._display = RichProgress(*columns, refresh_per_second=5, console=console)
        self._task = self._display.add_task(title, total=total, count="", tail="")

    @property
    def console(self) -> RichConsole:
        """What writes above it, on whole lines."""
        return self._display.console

    def say(self, text: str) -> None:
        """Write lines above it."""
        self.console.print(text, markup=False, highlight=False, emoji=False, soft_wrap=True)

    def update(self, done: float, line: str) -> None:
        """Show that `done` of the total is done; `line` says how it goes."""
        of = "" if self._total is None else f"/{format_count(self._total)}"
        count = f"{format_count(done)}{of} {self._unit}"
        layout = bar_line(self._display.console.width, self._title, count, line)
        self._bar.bar_width = layout.bar
        self._display.update(
            self._task,
            completed=done,
            description=layout.title,
            count=count,
            tail=layout.tail,
        )

    @contextmanager
    def shown(self) -> Iterator[MovingBar]:
        """Show it for as long as this lasts."""
        with self._display:
            yield self
