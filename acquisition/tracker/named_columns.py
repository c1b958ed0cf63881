"""`NamedColumns`: a text table of numbers with one line of column names."""

from __future__ import annotations

import csv
import difflib
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from acquisition.imports.lines import SEPARATORS, read_lines, split_cells
from config.arrays import BoolArray, FloatArray, IntArray
from config.errors import ConfigError
from config.formats.number import DECIMAL_COMMA, parse_number

HEADER: Final = "RID-TRACKER-COLUMNS"
ROW: Final = "RID-TRACKER-ROW"


@dataclass(frozen=True, eq=False)
class NamedColumns:
    """Cells of a table by the names of its columns; only columns in use must be numbers.

    Attributes:
        path: The file, for messages.
        header_row: Line of the column names, from 1.
        names: The column names, in order.
        rows: Shape (rows,). Line numbers in the file.
        cells: The cells of each row.
        has_decimal_commas: True if the numbers have decimal commas.
    """

    path: Path
    header_row: int
    names: tuple[str, ...]
    rows: IntArray
    cells: tuple[tuple[str, ...], ...]
    has_decimal_commas: bool

    def numbers(self, name: str, *, may_be_empty: bool = False) -> FloatArray:
        """Return the numbers of a column, (rows,).

        Args:
            name: Name of the column.
            may_be_empty: True if an empty cell becomes NaN instead of an error.

        Raises:
            ConfigError: A cell is not a number; the message names the line.
        """
        column = self.names.index(name)
        return np.array(
            [
                self._number(f"{self.path}:{row}: {name}", cells[column].strip(), may_be_empty)
                for row, cells in zip(self.rows, self.cells, strict=True)
            ],
            dtype=float,
        )

    def keep(self, kept: BoolArray) -> NamedColumns:
        """Return a table with the selected rows."""
        cells = tuple(row for row, is_kept in zip(self.cells, kept, strict=True) if is_kept)
        return replace(self, rows=self.rows[kept], cells=cells)

    def choose(self, forms: dict[str, float], what: str) -> tuple[str, float]:
        """Return the one column that has one of some names, and the factor of its unit.

        Args:
            forms: Possible names, each with the factor from its unit to SI.
            what: The quantity, for messages.

        Raises:
            ConfigError: None or several of the names are in the header.
        """
        found = [name for name in forms if name in self.names]
        if len(found) == 1:
            return found[0], forms[found[0]]
        where = f"{self.path}:{self.header_row}"
        if found:
            raise ConfigError(
                f"{where}: columns {' and '.join(found)} both give {what}: remove one of them",
                code=HEADER,
            )
        near = difflib.get_close_matches(next(iter(forms)), self.names, 2, 0.6)
        hint = f" (similar: {', '.join(near)})" if near else ""
        raise ConfigError(
            f"{where}: no column gives {what}: name it {' or '.join(forms)}{hint}", code=HEADER
        )

    def _number(self, where: str, text: str, may_be_empty: bool) -> float:
        if may_be_empty and not text:
            return math.nan
        if self.has_decimal_commas and "." in text:
            raise ConfigError(
                f"{where}: {text!r} has a decimal point, but other numbers of the file have a"
                " decimal comma: write all numbers in one way",
                code=ROW,
            )
        try:
            return parse_number(text.replace(",", ".") if self.has_decimal_commas else text)
        except ConfigError as error:
            raise ConfigError(f"{where}: {error}", code=error.refusal) from None


def read_named_columns(path: Path) -> NamedColumns:
    """Return the cells of a text table whose first line contains the column names.

    The delimiter is a comma, semicolon, tabulator or space: the one that splits the header into
    most names. Numbers have a decimal point, or in all cells a decimal comma if the delimiter is
    not the comma. A comment mark before the first name is ignored. Empty lines, and lines below the
    header that begin with `#` or `%`, are left out.

    Raises:
        ConfigError: The file cannot be read, has no header or no rows, or a row has another number
            of cells; the message names the line.
    """
    lines = list(read_lines(path))
    if not lines:
        raise ConfigError(f"{path}: is empty: give a table with column names", code=HEADER)
    header_row, header = lines[0]
    separator = _separator(path, header_row, header)
    names = [name.strip('"').strip() for name in _cells(path, header_row, header, separator)]
    _check_names(path, header_row, names)
    table = [
        (row, _cells(path, row, line, separator))
        for row, line in lines[1:]
        if not line.lstrip().startswith(("#", "%"))
    ]
    for row, cells in table:
        if len(cells) != len(names):
            raise ConfigError(
                f"{path}:{row}: has {len(cells)} cells, but line {header_row} has {len(names)}"
                f" column names{_comma_hint(separator, cells)}",
                code=ROW,
            )
    if not table:
        raise ConfigError(
            f"{path}: has no row below the column names: add the measured points", code=ROW
        )
    commas = separator != "," and any(
        DECIMAL_COMMA.fullmatch(cell) for _, cells in table for cell in cells
    )
    return NamedColumns(
        path,
        header_row,
        tuple(names),
        np.array([row for row, _ in table], dtype=np.int64),
        tuple(tuple(cells) for _, cells in table),
        commas,
    )


def _separator(path: Path, row: int, header: str) -> str | None:
    """Return the separator that splits the header into most names; the first one if several do."""
    widths = {
        separator: len(_cells(path, row, header, separator)) for separator in SEPARATORS.values()
    }
    return max(widths, key=lambda separator: widths[separator])


def _cells(path: Path, row: int, line: str, separator: str | None) -> list[str]:
    try:
        return split_cells(line, separator)
    except csv.Error as error:
        raise ConfigError(f"{path}:{row}: cannot be split into cells: {error}", code=ROW) from None


def _check_names(path: Path, row: int, names: Sequence[str]) -> None:
    """Refuse a header that has no names, or a name twice."""
    unnamed = [name for name in names if re.fullmatch(r"[-+\d.,eE ]*", name)]
    if unnamed:
        raise ConfigError(
            f"{path}:{row}: {unnamed[0]!r} is not a column name: write one line with the column"
            " names above the numbers",
            code=HEADER,
        )
    doubled = [name for name in names if names.count(name) > 1]
    if doubled:
        raise ConfigError(
            f"{path}:{row}: two columns are named {doubled[0]!r}: give each its own name",
            code=HEADER,
        )


def _comma_hint(separator: str | None, cells: Sequence[str]) -> str:
    if separator == "," and len(cells) > 1:
        return ": if the numbers have decimal commas, separate the columns by semicolons"
    return ""
