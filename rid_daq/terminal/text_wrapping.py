"""`wrap_text`: breaks sentences at words to a terminal's width."""

from __future__ import annotations

import re
import textwrap

_PASTED = re.compile(r"(?:^|: )\s*(rid-daq [a-z-]+ .*|/\S+)$")

_MARK = re.compile(r"\s*\S{1,9}\s{2,}(?=\S)")


def wrap_text(text: str, columns: int) -> str:
    """Return text with its lines broken at words to fit a terminal.

    Continuation lines are indented by two columns more than their first line. After a mark (such as
    `ok      `) they begin at the column of the text. A command of this program or a path at the end
    of a line stays whole, if necessary on its own line, so that it can be copied.

    Args:
        text: Lines of any length.
        columns: Width of the terminal.
    """
    return "\n".join(_wrap_line(line, columns) for line in text.split("\n"))


def _wrap_line(line: str, columns: int) -> str:
    if len(line) <= columns:
        return line
    pasted = _PASTED.search(line)
    if pasted is not None and pasted.start(1) > 0:
        before, whole = line[: pasted.start(1)].rstrip(), pasted[1]
        return f"{_wrap_words(before, columns)}\n  {whole}" if before else line
    return line if pasted is not None else _wrap_words(line, columns)


def _wrap_words(line: str, columns: int) -> str:
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
