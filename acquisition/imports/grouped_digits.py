"""`refuse_grouped_digits`: refuses columns in which `1.234` means 1234.

A single `1.234` can be a decimal number. Its point separates thousands if at least 50 numbers of
its column have a point before the last three digits, and the others, at least 20, have no point. If
the map's decimal separator is a comma, the same applies to `1,234`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from acquisition.imports.lines import SEPARATORS, read_lines, split_cells
from acquisition.imports.table import ImportTable
from acquisition.maps.import_map import ImportMap
from config.arrays import PIECE_ROWS, FloatArray, IntArray
from config.column_file import each_column
from config.errors import DataQualityError

FEWEST_GROUPED: Final = 50
FEWEST_PLAIN: Final = 20
_PLAIN: Final = re.compile(r"[-+]?\d{1,3}")


def refuse_grouped_digits(
    path: Path, import_map: ImportMap, table: ImportTable, columns: Sequence[int]
) -> None:
    """Refuse a file whose decimal separator separates the thousands of a column.

    Args:
        path: The first file; only its columns are checked.
        import_map: Layout of the files.
        table: The rows as read.
        columns: For each column of the table, its number, counted through all files.

    Raises:
        DataQualityError: All numbers of a column are whole if the separator is left out (at least
            50 with it and 20 without it); the text names the row and column.
    """
    width = import_map.first_columns[1]
    suspects = [
        column
        for column, values in zip(columns, each_column(table.values), strict=True)
        if column < width and _may_be_grouped(values)
    ]
    if suspects:
        _refuse_confirmed(path, import_map, table.row, suspects)


def _may_be_grouped(values: FloatArray) -> bool:
    """Return True if all numbers are below 1000, and those with a fraction can be thousands.

    These are at least 1, and their fraction has three digits at most. There are numbers without a
    fraction, too.
    """
    fractions = plain = 0
    for first in range(0, len(values), PIECE_ROWS):
        piece = values[first : first + PIECE_ROWS]
        piece = piece[np.isfinite(piece)]
        grouped = piece[piece != np.round(piece)]
        thousands = 1e3 * grouped
        if (
            (np.abs(grouped) < 1.0).any()
            or (np.abs(piece) >= 1e3).any()
            or not np.allclose(thousands, np.round(thousands), rtol=0.0, atol=1e-6)
        ):
            return False
        fractions += len(grouped)
        plain += len(piece) - len(grouped)
    return fractions >= FEWEST_GROUPED and plain >= FEWEST_PLAIN


def _refuse_confirmed(
    path: Path, import_map: ImportMap, rows: IntArray, suspects: Sequence[int]
) -> None:
    """Refuse the file if the texts of a column confirm that its digits are grouped."""
    separator, sign = SEPARATORS[import_map.delimiter], import_map.decimal
    grouped = re.compile(rf"[-+]?[1-9]\d{{0,2}}{re.escape(sign)}\d{{3}}")
    read = set(rows.tolist())
    found: dict[int, list[tuple[int, str]]] = {column: [] for column in suspects}
    plain: dict[int, str] = {}
    for row, line in read_lines(path):
        if row not in read:
            continue
        cells = split_cells(line, separator)
        for column in list(found):
            text = cells[column].strip('"')
            if grouped.fullmatch(text):
                found[column].append((row, text))
            elif _PLAIN.fullmatch(text):
                plain.setdefault(column, text)
            else:
                del found[column]
    for column, several in found.items():
        if len(several) >= FEWEST_GROUPED and column in plain:
            row, text = several[0]
            raise DataQualityError(
                f"{path.name} row {row}: column {column} is {text!r}, but other numbers of this"
                f" column are whole, such as {plain[column]!r}: {sign!r} separates thousands, and"
                " would be read as the decimal separator. Export the file without thousands"
                " separators",
                code="RID-IMPORT-UNITS",
            )
