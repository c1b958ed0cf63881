"""`look_at`: finds delimiter, header and first rows of a file without an import map."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Final

from acquisition.imports.lines import SEPARATORS, read_lines, split_by_delimiters, states_no_number
from acquisition.maps.time_column import match_date
from acquisition.proposals.column_groups import TIME_UNITS, UNITS
from acquisition.sources.array_tables import has_named_arrays, objects_in, read_named_arrays
from config.errors import ConfigError
from config.formats.number import DECIMAL_COMMA

_LINES: Final = 400
_FEWEST_COLUMNS: Final = 3
_FEWEST_ROWS: Final = 5
_MOST_JOINTS: Final = 100
_FEWEST_ABSENT: Final = 0.2
_SCOPE_NAMES: Final = "Name"
_SCOPE_UNITS: Final = "Unit"
_SCOPE_SYMBOLS: Final = "SymbolName"
_SCOPE_ROWS: Final = frozenset({_SCOPE_UNITS, "SampleTime[ms]", _SCOPE_SYMBOLS, "Data-Type"})
"""Beginnings of rows above the data of TwinCAT Scope View, besides that with the names."""

_OTHER_UNITS: Final = ("1", "bool", "v", "w", "kg", "-")
"""Units of columns that are not used, in lower case."""

_NUMBER: Final = re.compile(r"[-+]?(\d+([.,]\d*)?|[.,]\d+)([eE][-+]?\d+)?")


_ALL_UNITS: Final = frozenset(
    unit.lower() for units in (*UNITS.values(), TIME_UNITS, _OTHER_UNITS) for unit in units
)


@dataclass(frozen=True)
class SourceTable:
    """Columns of a file, as seen in its first rows.

    Attributes:
        names: Name of each column; empty if it has none.
        cells: First rows, as texts.
        keys: Keys of an import map that describe the text of the file.
        by_name: True if a map can name the columns; otherwise it gives their numbers.
        symbols: Other names of the columns, those of the variables in the controller; empty if the
            file has none.
        shorter: Names of columns with fewer samples than the others; empty for a text.
    """

    names: tuple[str, ...]
    cells: tuple[tuple[str, ...], ...]
    keys: dict[str, object] = field(default_factory=dict)
    by_name: bool = True
    symbols: tuple[str, ...] = ()
    shorter: tuple[str, ...] = ()


def look_at(path: Path) -> SourceTable:
    """Return the columns of a CSV file or of a file of arrays.

    Raises:
        ConfigError: The file cannot be read, or has no rows of numbers.
    """
    return _look_at_arrays(path) if has_named_arrays(path) else _look_at_text(path)


def _look_at_arrays(path: Path) -> SourceTable:
    columns: dict[str, list[str]] = {}
    shorter: list[str] = []
    arrays = read_named_arrays(path)
    samples = max((max(array.shape, default=0) for array in arrays.values()), default=0)
    for name, array in arrays.items():
        if samples not in array.shape:
            count = min(array.shape) if array.ndim == 2 else 0
            shorter += [f"{name}[{number}]" for number in range(min(count, _MOST_JOINTS))] or [name]
        elif array.size == samples == max(array.shape, default=0):
            columns[name] = [str(value) for value in array.reshape(-1)[:_LINES]]
        elif array.ndim == 2 and samples in array.shape:
            rows = array if array.shape[0] == samples else array.T
            for number, column in enumerate(rows.T):
                columns[f"{name}[{number}]"] = [str(value) for value in column[:_LINES]]
    if samples < _FEWEST_ROWS or not columns:
        raise _no_table(path, objects_in(path))
    cells = tuple(zip(*columns.values(), strict=True))
    return SourceTable(tuple(columns), cells, shorter=tuple(shorter))


def _look_at_text(path: Path) -> SourceTable:
    lines = list(islice(read_lines(path), _LINES))
    cells_by_delimiter = [split_by_delimiters(line) for _, line in lines]
    best: tuple[int, str, int] | None = None
    for delimiter in SEPARATORS:
        rows = [cells[delimiter] for cells in cells_by_delimiter]
        first = _first_row_of_numbers(rows)
        if first is not None and (best is None or len(rows[first]) > best[0]):
            best = len(rows[first]), delimiter, first
    if best is None:
        number, line = lines[min(1, len(lines) - 1)] if lines else (0, "")
        raise _no_table(
            path, f". Row {number} begins with {line.strip()[:40]!r}" if lines else "; it is empty"
        )
    width, delimiter, first = best
    rows = [cells[delimiter] for cells in cells_by_delimiter]
    if all(not row[-1] for row in rows[first:] if len(row) == width) and any(
        len(row) == width - 1 for row in rows[:first]
    ):
        width -= 1  # only the rows of numbers have a separator at their end
    rows = [row[:-1] if len(row) == width + 1 and not row[-1] else row for row in rows]
    heads = [number for number in range(first) if len(rows[number]) == width]
    of_units = next((number for number in heads if _are_units(rows[number])), None)
    header = max(
        (number for number in heads if number != of_units),
        key=lambda number: (len({*rows[number]}), -number),
        default=None,
    )
    scope = {rows[number][0]: number for number in heads}
    is_scope = _SCOPE_NAMES in scope and not _SCOPE_ROWS.isdisjoint(scope)
    if is_scope:
        header = scope[_SCOPE_NAMES]
    before = lines[first][0] - 1
    keys: dict[str, object] = {"delimiter": delimiter, "header_rows": before}
    cells = tuple(
        tuple("nan" if states_no_number(cell) else cell for cell in row)
        for row in rows[first:]
        if len(row) == width
    )
    if any(DECIMAL_COMMA.fullmatch(cell) for row in cells for cell in row):
        keys["decimal"] = ","
    named = ("",) * width if header is None else rows[header]
    if any(map(_is_sparse, named, zip(*cells, strict=True))):
        keys["empty_cells"] = "interpolate"
    by_name = header is not None and lines[header][0] == before and not is_scope
    by_name = by_name and of_units is None  # the units are added to the names
    if not by_name:
        keys["columns"] = width
    names = tuple(named)
    if of_units is not None and not is_scope:
        names = tuple(map(_with_unit, names, rows[of_units]))
    symbols: tuple[str, ...] = ()
    if is_scope:  # names, units and symbols are in several rows
        units = rows[scope[_SCOPE_UNITS]] if _SCOPE_UNITS in scope else [""] * width
        names = tuple(map(_with_scope_unit, names, units))
        if _SCOPE_SYMBOLS in scope:
            of_variables = (
                each.replace(_SCOPE_SYMBOLS, _SCOPE_NAMES) for each in rows[scope[_SCOPE_SYMBOLS]]
            )
            symbols = tuple(map(_with_scope_unit, of_variables, units))
    return SourceTable(names, cells, keys, by_name, symbols)


def _with_scope_unit(name: str, unit: str) -> str:
    """Return the name of a channel with its unit, which the scope writes as `V (Voltage)`."""
    symbol = unit.split("(")[0].strip()
    return name if not symbol or unit == _SCOPE_UNITS else f"{name} [{symbol}]"


def _are_units(cells: Sequence[str]) -> bool:
    """Return True if a row contains only units, at least two different ones."""
    found = {cell.strip("[]() ").lower() for cell in cells if cell.strip("[]() -")}
    return len(found) > 1 and found <= _ALL_UNITS


def _with_unit(name: str, cell: str) -> str:
    """Return the name of a column with the unit in another row of the header."""
    unit = cell.strip("[]() ")
    return name if not unit or unit == "-" else f"{name} [{unit}]"


def _is_sparse(name: str, column: Sequence[str]) -> bool:
    """Return True if cells are empty, or `nan` in many rows but not in all.

    A column without a name and without values follows a separator at the end of the rows.
    """
    if not name and not any(column):
        return False
    absent = sum(cell.lower() == "nan" for cell in column) / len(column)
    return not all(column) or _FEWEST_ABSENT < absent < 1.0


def _first_row_of_numbers(rows: list[list[str]]) -> int | None:
    """Return the first row of a block of equally long rows, mostly of numbers; None without one."""
    for first in range(len(rows) - _FEWEST_ROWS + 1):
        some = rows[first : first + _FEWEST_ROWS]
        if len({len(row) for row in some}) == 1 and len(some[0]) >= _FEWEST_COLUMNS:
            cells = [cell for row in some for cell in row if cell]
            numbers = sum(_is_number(cell) for cell in cells)
            if cells and numbers >= 0.6 * len(cells) and _is_first(some[0], some[-1]):
                return first
    return None


def _is_first(row: list[str], later: list[str]) -> bool:
    """Return True if a row is not a part of the header above the numbers.

    Most cells of the row are numbers, and its other cells are not numbers in a later row either.
    """
    numbers = sum(1 for cell in row if not cell or _is_number(cell))
    texts = [n for n, cell in enumerate(row) if cell and not _is_number(cell)]
    return numbers >= 0.6 * len(row) and not any(_is_number(later[n]) for n in texts)


def _is_number(cell: str) -> bool:
    return bool(_NUMBER.fullmatch(cell) or states_no_number(cell) or match_date(cell))


def _no_table(path: Path, why: str) -> ConfigError:
    return ConfigError(
        f"{path}: no import map can be proposed, because the file has no {_FEWEST_ROWS} rows of"
        f" at least {_FEWEST_COLUMNS} numbers{why}. Give a table of numbers (`rid-daq docs"
        " someone-elses-recording`)",
        code="RID-IMPORT-PROPOSAL",
    )
