"""`look_at`: finds delimiter, header and first rows of a file that nobody has described."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Final

from acquisition.imports.lines import DECIMAL_COMMA, SEPARATORS, read_lines, split_cells
from acquisition.imports.time_column import match_iso
from acquisition.sources.array_tables import has_named_arrays, read_named_arrays
from config.errors import ConfigError

_LINES: Final = 400
_FEWEST_COLUMNS: Final = 3
_FEWEST_ROWS: Final = 5
_NUMBER: Final = re.compile(r"[-+]?(\d+([.,]\d*)?|[.,]\d+)([eE][-+]?\d+)?|nan", re.IGNORECASE)


@dataclass(frozen=True)
class SourceTable:
    """Columns of a file, as far as its first rows show them.

    Attributes:
        names: Name of each column; empty if it has none.
        cells: First rows, as texts.
        keys: Keys of an import map that describe the text of the file.
        by_name: True if a map can name the columns; otherwise it gives their numbers.
    """

    names: tuple[str, ...]
    cells: tuple[tuple[str, ...], ...]
    keys: dict[str, object] = field(default_factory=dict)
    by_name: bool = True


def look_at(path: Path) -> SourceTable:
    """Return the columns of a CSV file or of a file of arrays.

    Raises:
        ConfigError: The file cannot be read, or has no rows of numbers.
    """
    return _look_at_arrays(path) if has_named_arrays(path) else _look_at_text(path)


def _look_at_arrays(path: Path) -> SourceTable:
    columns: dict[str, list[str]] = {}
    arrays = read_named_arrays(path)
    samples = max((max(array.shape, default=0) for array in arrays.values()), default=0)
    for name, array in arrays.items():
        if array.size == samples == max(array.shape, default=0):
            columns[name] = [str(value) for value in array.reshape(-1)[:_LINES]]
        elif array.ndim == 2 and samples in array.shape:
            rows = array if array.shape[0] == samples else array.T
            for number, column in enumerate(rows.T):
                columns[f"{name}[{number}]"] = [str(value) for value in column[:_LINES]]
    if samples < _FEWEST_ROWS or not columns:
        raise _no_table(path)
    return SourceTable(tuple(columns), tuple(zip(*columns.values(), strict=True)))


def _look_at_text(path: Path) -> SourceTable:
    lines = list(islice(read_lines(path), _LINES))
    best: tuple[int, str, int] | None = None
    for delimiter, separator in SEPARATORS.items():
        rows = [_split(line, separator) for _, line in lines]
        first = _first_row_of_numbers(rows)
        if first is not None and (best is None or len(rows[first]) > best[0]):
            best = len(rows[first]), delimiter, first
    if best is None:
        raise _no_table(path)
    width, delimiter, first = best
    rows = [_split(line, SEPARATORS[delimiter]) for _, line in lines]
    heads = [number for number in range(first) if len(rows[number]) == width]
    header = max(heads, key=lambda number: (len({*rows[number]}), -number), default=None)
    before = lines[first][0] - 1
    keys: dict[str, object] = {"delimiter": delimiter, "header_rows": before}
    cells = tuple(tuple(row) for row in rows[first:] if len(row) == width)
    if any(DECIMAL_COMMA.fullmatch(cell) for row in cells for cell in row):
        keys["decimal"] = ","
    if any(not cell for row in cells for cell in row):
        keys["empty_cells"] = "interpolate"
    by_name = header is not None and lines[header][0] == before
    if not by_name:
        keys["columns"] = width
    names = ("",) * width if header is None else tuple(rows[header])
    return SourceTable(names, cells, keys, by_name)


def _first_row_of_numbers(rows: list[list[str]]) -> int | None:
    """Return the first of several rows that have equally many cells, most of them numbers."""
    for first in range(len(rows) - _FEWEST_ROWS + 1):
        some = rows[first : first + _FEWEST_ROWS]
        if len({len(row) for row in some}) == 1 and len(some[0]) >= _FEWEST_COLUMNS:
            cells = [cell for row in some for cell in row if cell]
            numbers = sum(1 for cell in cells if _NUMBER.fullmatch(cell) or match_iso(cell))
            if cells and numbers >= 0.6 * len(cells) and _is_number_or_empty(some[0]):
                return first
    return None


def _is_number_or_empty(row: list[str]) -> bool:
    """Return True if most cells of a row are numbers: it is not the header above them."""
    numbers = sum(1 for cell in row if not cell or _NUMBER.fullmatch(cell) or match_iso(cell))
    return numbers >= 0.6 * len(row)


def _split(line: str, separator: str | None) -> list[str]:
    try:
        return split_cells(line, separator)
    except csv.Error:
        return []


def _no_table(path: Path) -> ConfigError:
    return ConfigError(
        f"{path}: no import map can be proposed, because the file has no {_FEWEST_ROWS} rows of"
        f" at least {_FEWEST_COLUMNS} numbers. Write a map (`rid-daq docs"
        " someone-elses-recording`)",
        code="RID-IMPORT-PROPOSAL",
    )
