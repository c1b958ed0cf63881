"""Progress bar of a long step: title, bar, amount, time left, and status on one line."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console as RichConsole

BAR = (10, 24)  # smallest and largest width of the bar [columns]
_TIME_LEFT = 8  # 99:59:59
_TAIL = 28  # the status gets up to this width before the bar grows [columns]
_BREAKS = re.compile(r"; |, | \(")


@dataclass(frozen=True)
class BarLine:
    """Layout of one line of the display.

    Attributes:
        title: Title of the step, shortened.
        bar: Width of the bar [columns].
        tail: Status, shortened.
    """

    title: str
    bar: int
    tail: str


def bar_line(width: int, title: str, count: str, tail: str) -> BarLine:
    """Return the layout of a line in which bar, amount and time left have room.

    Args:
        width: Width of the terminal [columns].
        title: Title of the step.
        count: Amount done.
        tail: Status, most important part first.
    """
    title = shorten(title, max(width // 4, 8))
    free = width - len(title) - len(count) - _TIME_LEFT - 4  # four gaps of one column
    least, most = BAR
    whole = _BREAKS.search(tail)
    first = len(tail) if whole is None else whole.start()  # kept whole if there is room
    bar = max(least, min(most, free - max(first, min(_TAIL, len(tail)))))
    return BarLine(title, bar, shorten(tail, free - bar))


def shorten(text: str, room: int) -> str:
    """Return the leading parts of a text that fit `room` columns; parts end at `;`, `,` or `(`.

    A text whose first part does not fit is cut, with an ellipsis.
    """
    if len(text) <= room:
        return text
    ends = [found.start() for found in _BREAKS.finditer(text) if found.start() <= room]
    if ends:
        return text[: ends[-1]]
    return f"{text[: room - 1]}…" if room > 1 else ""


def format_count(number: float) -> str:
    """Return an amount, with one decimal if it is small and not whole."""
    return f"{number:.0f}" if number >= 10 or number == int(number) else f"{number:.1f}"


class ProgressBar:
    """Progress bar of one step on a terminal."""

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
        """Console that writes whole lines above the bar."""
        return self._display.console

    def say(self, text: str) -> None:
        """Write lines above the bar."""
        self.console.print(text, markup=False, highlight=False, emoji=False, soft_wrap=True)

    def update(self, done: float, line: str) -> None:
        """Show the amount done, and the status `line`."""
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
    def shown(self) -> Iterator[ProgressBar]:
        """Show the bar within a `with` block."""
        with self._display:
            yield self
