"""`print_table`: a table's columns on a terminal, so that no number and no unit is broken.

Columns share the width that is there. A table of values that is too wide even with every text
broken at its words is shown in parts, one under the other, each beginning with the columns that say
what a row is.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

from rich.cells import cell_len
from rich.console import Console as RichConsole
from rich.table import Table
from rich.text import Text

GAP: Final = 2  # columns between two of them
_NAME_LENGTH: Final = 26  # a run id; what is longer may be broken into lines
_LITTLE: Final = 8  # columns that a head may lack to stand on one line
_WHOLE: Final = 18  # a cell up to so long is a value with its unit, and is not broken

Part = list[tuple[int, int]]
"""Columns of one part of a table: the number of each and its width."""


def print_table(
    terminal: RichConsole,
    head: Sequence[str],
    rows: Sequence[Sequence[str]],
    red: Sequence[bool] | None = None,
    key: int = 1,
) -> None:
    """Write a table on a terminal; the other parameters as `Console.table` has them."""
    names = all(len(row[0]) <= _NAME_LENGTH for row in rows)
    parts = laid_out((head, *rows), terminal.width, key)
    unbound: list[tuple[int, int | None]] = [(number, None) for number in range(len(head))]
    shown = [unbound] if parts is None else [[*part] for part in parts]
    for part in shown:
        table = Table(box=None, pad_edge=False, header_style="bold")
        for number, width in part:
            table.add_column(
                Text(head[number]), width=width, no_wrap=names and not number, overflow="fold"
            )
        for number, row in enumerate(rows):
            style = "red" if red is not None and red[number] else None
            table.add_row(*[Text(row[column]) for column, _ in part], style=style)
        terminal.print(table)


def laid_out(table: Sequence[Sequence[str]], columns: int, key: int = 1) -> list[Part] | None:
    """Return the parts in which a table is shown; None where its words do not fit.

    Args:
        table: The head and the rows, as many cells in each.
        columns: Width of the terminal.
        key: How many of the first columns say what a row is: every part begins with them.
    """
    cells = [[row[number] for row in table] for number in range(len(table[0]))]
    natural = [max(map(cell_len, column)) for column in cells]
    whole = [max((_longest_word(head), *map(_unbroken, body))) for head, *body in cells]
    words = [max(map(_longest_word, column)) for column in cells]
    everything = range(len(cells))
    for least in (whole, words):
        if _width(least, everything) <= columns:
            return [_shared(everything, least, natural, columns)]
    if any(cell_len(cell) > _WHOLE for row in table[1:] for cell in row[key:]):
        return None  # texts, which are better broken than far from each other
    for count in range(2, len(cells) - key + 1):
        parts = [[*range(key), *own] for own in _dealt(key, len(cells), count)]
        if all(_width(whole, part) <= columns for part in parts):
            return [_shared(part, whole, natural, columns) for part in parts]
    return None


def _unbroken(cell: str) -> int:
    return cell_len(cell) if cell_len(cell) <= _WHOLE else _longest_word(cell)


def _longest_word(cell: str) -> int:
    return max(map(cell_len, cell.split()), default=0)


def _width(widths: Sequence[int], part: Sequence[int]) -> int:
    return sum(widths[number] for number in part) + GAP * (len(part) - 1)


def _dealt(first: int, end: int, count: int) -> list[range]:
    """Return the numbers from `first` to `end` in so many runs, as equal as can be."""
    edges = [first + (end - first) * i // count for i in range(count + 1)]
    return [range(low, high) for low, high in pairwise(edges)]


def _shared(
    part: Sequence[int], least: Sequence[int], natural: Sequence[int], columns: int
) -> Part:
    """Give what is left to those columns that want little more, then to all as much to each."""
    widths = {number: least[number] for number in part}
    left = columns - _width(least, part)
    for number in sorted(part, key=lambda each: natural[each] - least[each]):
        more = natural[number] - least[number]
        if more <= min(_LITTLE, left):
            widths[number] += more
            left -= more
    while left > 0 and (wanting := [n for n in part if widths[n] < natural[n]]):
        for number in wanting[:left]:
            widths[number] += 1
        left -= len(wanting[:left])
    return list(widths.items())
