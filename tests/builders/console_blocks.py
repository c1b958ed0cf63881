"""Console blocks of Markdown pages: commands after a prompt, and the output that a page shows.

A comment before a block in a guide names a test. This test runs the command and compares the block
with the output, by `assert_shown`.
"""

from __future__ import annotations

import os
import re
import shlex
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from tests.builders.code_lines import ROOT

PROGRAM: Final = "rid-daq"
GUIDES: Final = ROOT / "docs" / "guide"
_NUMBER: Final = re.compile(r"[-−+]?\d+(?:\.\d+)*(?:e-?\d+|·10[⁻⁰¹²³⁴-⁹]+)?")
_HEXADECIMAL: Final = re.compile(r"(?<![\w.])[0-9A-F]{4}(?:[0-9A-F]{4})?(?![\w.])")
_RUN: Final = re.compile(r"\b[0-9A-HJKMNP-TV-Z]{26}\b")
_PATH: Final = re.compile(r"/\S+")
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


def assert_shown(page: str, command: str, output: str, *, same_numbers: bool = True) -> None:
    """Compare the output of a command with the block of a guide that names the running test.

    Args:
        page: Name of the guide, without `.md`.
        command: The command as the guide shows it, without its prompt.
        output: The complete output of the command.
        same_numbers: False if the numbers depend on the run or on the computer.
    """
    test = os.environ["PYTEST_CURRENT_TEST"].partition(" (")[0].partition("[")[0]
    steps = [
        step
        for step in console_steps(GUIDES / f"{page}.md")
        if step.command == command and step.shown and step.test == test
    ]
    assert steps, f"{page}.md shows no output of `{command}` that names {test}"
    for step in steps:
        end = require_shown(step.shown, output, step.place, same_numbers=same_numbers)
        assert not end or step.shown[-1] == "…", f"{step.place}: then the command prints {end!r}"


def require_shown(
    shown: Sequence[str], output: str, place: str, *, same_numbers: bool = False
) -> str:
    """Compare the lines that a page shows with an output, and return the rest of the output.

    Paths, run ids and the widths of columns may differ. An ellipsis matches any text.

    Args:
        shown: Lines of the page.
        output: What the command printed.
        place: Page and line, for messages.
        same_numbers: True to compare the numbers too.
    """
    text, at = _comparable(output, same_numbers), 0
    for number, part in enumerate("\n".join(shown).split("…")):
        wanted = _comparable(part, same_numbers)
        found = text.find(wanted, at)
        assert found >= 0, f"{place} shows {wanted!r}, after {text[:at]!r} is {text[at:]!r}"
        assert number or not found, f"{place}: begins with {text[:found]!r}"
        at = found + len(wanted)
    return text[at:].strip()


def _comparable(text: str, same_numbers: bool) -> str:
    """Return a text on one line, with placeholders for paths and run ids.

    Unless `same_numbers`, numbers are replaced too.
    """
    text = _RUN.sub("RUN", _PATH.sub("PATH", text))
    if not same_numbers:
        text = _NUMBER.sub("#", _HEXADECIMAL.sub("#", text))
    return " ".join(text.split())


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
