"""`fitted`: sentences broken at words to a terminal's width; what is pasted is never broken."""

from __future__ import annotations

import re
import textwrap

_PASTED = re.compile(r"(?:^|: )\s*(rid-daq [a-z-]+ .*|/\S+)$")

_MARK = re.compile(r"\s*\S{1,9}\s{2,}(?=\S)")


def fitted(text: str, columns: int) -> str:
    """Return text whose lines fit a terminal.

    A line's own indent is kept, and its further lines have two columns more, or begin where the
    text behind a mark (`ok      `) begins. A command of this
    program or a path at a line's end stays whole, on a line of its own where it must, so that it
    can be pasted.

    Args:
        text: Lines of any length.
        columns: Width of the terminal.
    """
    return "\n".join(_fitted_line(line, columns) for line in text.split("\n"))


def _fitted_line(line: str, columns: int) -> str:
    if len(line) <= columns:
        return line
    pasted = _PASTED.search(line)
    if pasted is not None and pasted.start(1) > 0:
        before, whole = line[: pasted.start(1)].rstrip(), pasted[1]
        return f"{_wrapped(before, columns)}\n  {whole}" if before else line
    return line if pasted is not None else _wrapped(line, columns)


def _wrapped(line: str, columns: int) -> str:
    indent = line[: len(line) - len(line.lstrip())]
    marked = _MARK.match(line)
    hanging = f"{indent}  " if marked is None else " " * marked.end()
    return textwrap.fill(
        line[len(indent) if marked is None else marked.end() :].strip(),
        columns,
        initial_indent=indent if marked is None else marked[0],
        subsequent_indent=hanging,
        break_long_words=False,
        break_on_hyphens=False,
    )
