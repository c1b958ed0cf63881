"""Console blocks of Markdown pages: commands after a prompt, and the output that a page shows."""

from __future__ import annotations

import re
import shlex
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from tests.builders.code_lines import ROOT

PROGRAM: Final = "rid-daq"
_BLOCK: Final = re.compile(
    r"(?:^[ ]*<!-- shown by (?P<test>\S+) -->\n)?^[ ]*```console\n(?P<text>.*?)^[ ]*```$",
    re.DOTALL | re.MULTILINE,
)


@dataclass(frozen=True)
class ConsoleStep:
    """A command of a console block.

    Attributes:
        place: Page and line, for messages.
        command: Command without its prompt; continued lines are joined.
        shown: Lines of output that the page shows.
        test: Test that compares the output, `FILE::FUNCTION`; empty if the block names no test.
    """

    place: str
    command: str
    shown: tuple[str, ...]
    test: str


def console_steps(page: Path) -> Iterator[ConsoleStep]:
    """Yield each command of a page's console blocks."""
    text = page.read_text(encoding="utf-8")
    for block in _BLOCK.finditer(text):
        first = text.count("\n", 0, block.start("text")) + 1
        lines = textwrap.dedent(block["text"]).splitlines()
        starts = [number for number, line in enumerate(lines) if line.startswith("$ ")]
        for start, end in zip(starts, [*starts[1:], len(lines)], strict=True):
            command, *shown = lines[start:end]
            while command.endswith("\\"):
                command = command.removesuffix("\\") + shown.pop(0).strip()
            place = f"{page.relative_to(ROOT)}:{first + start}"
            yield ConsoleStep(place, command.removeprefix("$ "), tuple(shown), block["test"] or "")


def program_arguments(command: str) -> Iterator[list[str]]:
    """Yield the arguments of each call of the program in a shell command."""
    lexer = shlex.shlex(command, posix=True, punctuation_chars="();<>|&\n")
    lexer.whitespace_split = True
    arguments: list[str] | None = None
    at_start = True
    for word in lexer:
        if set(word) <= set("();<>|&"):
            if arguments is not None:
                yield arguments
            arguments, at_start = None, not set(word) & set("<>")
            continue
        if at_start and word.rpartition("/")[2] == PROGRAM:
            arguments = []
        elif arguments is not None:
            arguments.append(word)
        at_start = False
    if arguments is not None:
        yield arguments
