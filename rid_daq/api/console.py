"""`SilentConsole` and `TextConsole`: consoles of operations that the API runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from rid_daq.blocks.block import AnyBlock
from rid_daq.terminal.block_printer import print_blocks
from rid_daq.terminal.console import Console, make_printable
from rid_daq.terminal.context import Progress

ProgressCallback = Callable[[str, float, float | None], None]
"""Called with the name of a step, the amount done, and the total (None if it is unknown)."""


@dataclass(frozen=True)
class SilentConsole(Console):
    """A console that shows no text, asks no one, and reports progress to a callback."""

    as_json: bool = True
    callback: ProgressCallback | None = None

    @property
    def can_ask(self) -> bool:
        """False: this console asks no questions."""
        return False

    @contextmanager
    def progress(self, title: str, total: float | None, unit: str) -> Iterator[Progress]:
        """Report the progress of a step to the callback."""
        yield _Step(title, total, self.callback or (lambda _title, _done, _total: None))


@dataclass(frozen=True)
class _Step:
    title: str
    total: float | None
    callback: ProgressCallback

    def update(self, done: float, line: str) -> None:
        """Report the amount done to the callback."""
        self.callback(f"{self.title}: {line}" if line else self.title, done, self.total)


@dataclass(frozen=True)
class TextConsole(Console):
    """A console that keeps its lines in `lines` and prints nothing."""

    lines: list[str] = field(default_factory=list)

    @property
    def is_terminal(self) -> bool:
        """False: tables are not narrowed to the width of a terminal."""
        return False

    def say(self, text: str = "") -> None:
        """Keep a line."""
        self.lines.append(make_printable(text))


def text_of(blocks: Iterable[AnyBlock]) -> str:
    """Return blocks as the text that the command line writes into a file."""
    console = TextConsole()
    print_blocks(blocks, console)
    return "\n".join(console.lines)
