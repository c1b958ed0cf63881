"""`RowReader`: collects the numbers of a file's rows, by blocks or line by line."""

from __future__ import annotations

import csv
import math
from array import array
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from acquisition.imports.lines import (
    SEPARATORS,
    lines_of_block,
    split_by_delimiters,
    states_no_number,
)
from acquisition.imports.number_blocks import NumberBlocks
from acquisition.imports.report import DamagedRow
from acquisition.maps.import_map import ImportMap
from acquisition.maps.time_column import Stamps
from config.arrays import FloatArray, IntArray
from config.column_file import ColumnFile
from config.errors import ConfigError
from config.formats.number import parse_number

_MOST_PLACES = 20_000  # length of a list in memory; it has two numbers for each row
_NO_NUMBER = (ConfigError, ValueError, OverflowError)


class RowReader:
    """Numbers of the rows of one file; rows that are not numbers are reported and left out.

    Args:
        import_map: Layout of the file.
        width: Number of columns of the file.
        wanted: Columns to read, from 0 in this file.
        may_be_empty: For each of these columns, True if cells may be empty; an empty cell, or one
            that states that its number is missing, such as `null`, becomes NaN.
        roles: Role of each column, for messages.
        stamps: Collects the time stamps; None without a column of time.
        damaged: List to which the dropped rows are appended.
        most_rows: Largest number of rows that the file can have.

    Attributes:
        last_row: Number of the last row that was seen.
        found: Number of rows in the requested range, including damaged ones.
    """

    def __init__(
        self,
        import_map: ImportMap,
        width: int,
        wanted: Sequence[int],
        may_be_empty: Sequence[bool],
        roles: Mapping[int, str],
        stamps: Stamps | None,
        damaged: list[DamagedRow],
        most_rows: int,
    ) -> None:
        self._map = import_map
        self._width = width
        self._wanted, self._may_be_empty = wanted, may_be_empty
        self._roles = roles
        self._stamps, self._damaged = stamps, damaged
        self._numbers = ColumnFile(len(wanted), most_rows)
        self._places = ColumnFile(2, most_rows, np.int64)
        self._line_numbers, self._line_places = array("d"), array("q")
        self._count = self.found = self.last_row = 0
        self._blocks = None
        whole = () if stamps is None else stamps.whole_columns
        if whole is not None:
            more = () if stamps is None or whole else stamps.columns
            self._blocks = NumberBlocks(import_map, width, (*wanted, *more), whole)

    def numbers(self) -> FloatArray:
        """Return the wanted columns, shape (rows, wanted)."""
        return self._numbers.table()

    def rows(self) -> IntArray:
        """Return the number of each row in the file, from 1."""
        return self._places.table()[:, 0]

    def counts(self) -> FloatArray:
        """Return the number of each row among the non-empty rows after the header, from 1."""
        return self._places.table()[:, 1].astype(np.float64)

    def add_block(self, first: int, text: str, begin: int, last: float) -> None:
        """Read the rows of a block.

        Args:
            first: Number of the block's first line.
            text: Whole lines.
            begin, last: Range of the rows to read; reading ends after the row `last`.
        """
        end = first + text.count("\n")
        is_whole = first >= begin and first > self._map.header_rows and end - 1 <= last
        if is_whole and text.endswith("\n") and self._add_plain_block(first, text):
            return
        for row, line in lines_of_block(first, text):
            self.last_row = row
            if row > last:
                break
            if row <= self._map.header_rows:
                continue
            self._count += 1
            if row >= begin:
                self.found += 1
                self._add_line(row, line)
            if len(self._line_places) >= _MOST_PLACES:
                self._append_lines()
        self._append_lines()

    def _append_lines(self) -> None:
        """Append the rows that were read one by one."""
        numbers = np.frombuffer(self._line_numbers).reshape(-1, len(self._wanted))
        self._numbers.append(numbers)
        self._places.append(np.frombuffer(self._line_places, np.int64).reshape(-1, 2))
        self._line_numbers, self._line_places = array("d"), array("q")

    def _add_plain_block(self, first: int, text: str) -> bool:
        """Read a block at once; read nothing and return False if a row must be read alone."""
        read = None if self._blocks is None else self._blocks.convert(text)
        if read is None:
            return False
        floats, whole = read
        width, lines = len(self._wanted), len(floats)
        if self._stamps is not None and not self._stamps.extend(floats[:, width:], whole):
            return False
        self._numbers.append(floats[:, :width])
        number = np.arange(lines)
        self._places.append(np.stack([first + number, self._count + 1 + number], axis=1))
        self._count += lines
        self.found += lines
        self.last_row = first + lines - 1
        return True

    def _add_line(self, row: int, line: str) -> None:
        """Read one line, or report it as damaged."""
        fields, read_one = _split(line, self._map)
        if len(fields) == self._width + 1 and not fields[-1].strip():
            del fields[-1]  # a separator after the last number
        if len(fields) != self._width:
            detail = f"{len(fields)} columns instead of {self._width}"
            detail += _delimiter_hint(line, self._map, self._width)
            self._damaged.append(DamagedRow(row, "with a wrong number of columns", detail))
            return
        try:
            read = [read_one(fields[column]) for column in self._wanted]
        except _NO_NUMBER:
            read, bad = _read_with_gaps(fields, self._wanted, self._may_be_empty, read_one)
            if bad is not None:
                detail = f"{_describe(bad, fields[bad])} ({self._roles[bad]})"
                self._damaged.append(DamagedRow(row, "without a number", detail))
                return
        if self._stamps is not None:
            try:
                self._stamps.append(fields, read_one)
            except _NO_NUMBER:
                text = ", ".join(_describe(each, fields[each]) for each in self._stamps.columns)
                self._damaged.append(DamagedRow(row, "without a time stamp", text))
                return
        self._line_numbers.extend(read)
        self._line_places.extend((row, self._count))


def _split(line: str, import_map: ImportMap) -> tuple[list[str], Callable[[str], float]]:
    """Return the fields of a line, and the function that converts a field to a number."""
    separator, comma = SEPARATORS[import_map.delimiter], import_map.decimal == ","
    odd = "_" in line or not line.isascii() or (comma and "." in line)
    if separator == "," and comma and '"' not in line:
        return [], float  # in unquoted text, a decimal comma looks like a delimiter
    if '"' in line and separator is not None:
        try:
            fields = next(csv.reader([line], delimiter=separator, skipinitialspace=True))
        except csv.Error:
            return [], float
        if comma and not odd:
            fields = [field.replace(",", ".") for field in fields]
    else:
        if comma and not odd:
            line = line.replace(",", ".")
        fields = line.replace('"', "").split(separator)
    return fields, _strict_parser(import_map.decimal) if odd else float


def _read_with_gaps(
    fields: Sequence[str],
    columns: Sequence[int],
    may_be_empty: Sequence[bool],
    read: Callable[[str], float],
) -> tuple[list[float], int | None]:
    """Return the numbers, NaN for permitted empty cells, and the first column without a number."""
    numbers: list[float] = []
    for column, permitted in zip(columns, may_be_empty, strict=True):
        if permitted and (not fields[column].strip() or states_no_number(fields[column])):
            numbers.append(math.nan)
            continue
        try:
            numbers.append(read(fields[column]))
        except _NO_NUMBER:
            return numbers, column
    return numbers, None


def _strict_parser(decimal: str) -> Callable[[str], float]:
    """Return a parser that refuses `1_5`, which `float` accepts, and `1.234,5`."""

    def read(text: str) -> float:
        if decimal == ",":
            if "." in text:
                raise ConfigError(
                    f"{text!r} has a decimal point, but `decimal` of the map is a comma: correct"
                    " `decimal`, or the number",
                    code="RID-FILE-NUMBER",
                )
            text = text.replace(",", ".")
        return parse_number(text)

    return read


def _describe(column: int, text: str) -> str:
    """Return the number and the text of a cell's column, for a message."""
    words = text.strip()[:40]
    return f"column {column} is {words!r}" if words else f"column {column} is empty"


def _delimiter_hint(line: str, import_map: ImportMap, columns: int) -> str:
    """Return a hint if another delimiter would give the right number of columns."""
    if import_map.decimal == import_map.delimiter and '"' not in line:
        return "; decimal and delimiter are both ',', so numbers must be quoted"
    for name, cells in split_by_delimiters(line).items():
        if name != import_map.delimiter and len(cells) == columns:
            return f"; with `delimiter: {name!r}` in the map, it has {columns} columns"
    return ""
