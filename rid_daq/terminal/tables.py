"""`print_table`: prints a table on a terminal, if possible without breaking numbers or units.

The columns share the terminal's width. If a table of values is too wide even with all texts broken
at words, it is printed in parts below each other. Each part begins with the columns that identify a
row.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

from rich.cells import cell_len
from rich.console import Console as RichConsole
from rich.table import Table
from rich.text import Text

GAP: Final = 2  # gap between two columns of a table [characters]
_NAME_LENGTH: Final = 26  # length of a run id; longer names may be broken
_LITTLE: Final = 8  # a column that needs at most this many more characters gets them first
_WHOLE: Final = 18  # cells up to this length are values with units and are not broken

Part = list[tuple[int, int]]
"""Columns of one part of a table: number and width of each column."""


def print_table(
    terminal: RichConsole,
    head: Sequence[str],
    rows: Sequence[Sequence[str]],
    red: Sequence[bool] | None = None,
    key: int = 1,
) -> None:
    """Print a table on a terminal; `Console.table` describes the parameters."""
    names = all(len(row[0]) <= _NAME_LENGTH for row in rows)
    parts = layout_parts((head, *rows), terminal.width, key)
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


def layout_parts(table: Sequence[Sequence[str]], columns: int, key: int = 1) -> list[Part] | None:
    """Return the parts in which a table is printed; None if its words must be broken.

    Args:
        table: The head and the rows, with the same number of cells.
        columns: Width of the terminal.
        key: Number of leading columns that identify a row; every part begins with them.
    """
    cells = [[row[number] for row in table] for number in range(len(table[0]))]
    natural = [max(map(cell_len, column)) for column in cells]
    whole = [max((_longest_word(head), *map(_unbroken_width, body))) for head, *body in cells]
    words = [max(map(_longest_word, column)) for column in cells]
    everything = range(len(cells))
    for least in (whole, words):
        if _width(least, everything) <= columns:
            return [_distribute_width(everything, least, natural, columns)]
    if any(cell_len(cell) > _WHOLE for row in table[1:] for cell in row[key:]):
        return None  # a table with long texts is not split into parts: its words are broken
    for count in range(2, len(cells) - key + 1):
        parts = [[*range(key), *own] for own in _split_evenly(key, len(cells), count)]
        if all(_width(whole, part) <= columns for part in parts):
            return [_distribute_width(part, whole, natural, columns) for part in parts]
    return None


def _unbroken_width(cell: str) -> int:
    return cell_len(cell) if cell_len(cell) <= _WHOLE else _longest_word(cell)


def _longest_word(cell: str) -> int:
    return max(map(cell_len, cell.split()), default=0)


def _width(widths: Sequence[int], part: Sequence[int]) -> int:
    return sum(widths[number] for number in part) + GAP * (len(part) - 1)


def _split_evenly(first: int, end: int, count: int) -> list[range]:
    """Split the numbers from `first` to `end` into `count` ranges of nearly equal length."""
    edges = [first + (end - first) * i // count for i in range(count + 1)]
    return [range(low, high) for low, high in pairwise(edges)]


def _distribute_width(
    part: Sequence[int], least: Sequence[int], natural: Sequence[int], columns: int
) -> Part:
    """Distribute the free width: first to columns that need little, then equally to all."""
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
