"""`read_tables`: reads CSV files as numbers, interpolated to the times of the first file."""

from __future__ import annotations

import csv
import math
from array import array
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from acquisition.imports.import_map import ImportMap, RowRange
from acquisition.imports.lines import SEPARATORS, read_lines
from acquisition.imports.merged_topics import merge_topics, rows_near
from acquisition.imports.report import DamagedRow
from acquisition.imports.table import ImportTable, find_unordered
from acquisition.imports.time_column import Stamps, numbered
from config.errors import ConfigError, DataQualityError
from config.formats.number import parse_number

_NO_NUMBER = (ConfigError, ValueError, OverflowError)


def read_tables(
    files: Sequence[Path],
    import_map: ImportMap,
    columns: Sequence[int],
    damaged: list[DamagedRow],
    optional: Collection[int] = (),
) -> ImportTable:
    """Read files with a map; rows that are not numbers are reported and left out.

    Args:
        files: The first file, then the `further_files` of the map.
        import_map: Layout of the files, without names of columns (`number_columns`).
        columns: Requested columns, counted through all files.
        damaged: List to which the dropped rows are appended, as rows of the first file.
        optional: Requested columns in which cells may be empty; an empty cell becomes NaN.

    Raises:
        ConfigError: A file cannot be read, or it ends before the rows that the map requests.
    """
    first = _read_file(files[0], import_map, 0, columns, damaged, optional, None)
    for number, path in enumerate(files[1:], start=1):
        origin = first.origin_ns
        other = _read_file(path, import_map, number, columns, [], optional, origin)
        first = _append_columns(first, other, path, damaged)
    return first


def _read_file(
    path: Path,
    import_map: ImportMap,
    number: int,
    columns: Sequence[int],
    damaged: list[DamagedRow],
    optional: Collection[int],
    origin_ns: int | None,
) -> ImportTable:
    """Read one file; the columns that belong to other files are NaN."""
    begin, end = import_map.first_columns[number : number + 2]
    time = import_map.time_column_of_file(number)
    stamps = None if time is None else Stamps(time)
    here = [i for i, column in enumerate(columns) if begin <= column < end]
    wanted = [columns[i] - begin for i in here]
    roles = {numbered(column) - begin: role for column, role in import_map.column_roles.items()}
    merged = import_map.empty_cells == "interpolate"
    may_be_empty = [merged or columns[i] in optional for i in here]
    row_range = import_map.rows if number == 0 else RowRange()
    last = row_range.last or math.inf
    numbers, rows, counts = array("d"), array("q"), array("q")
    count = found = row = 0
    for row, line in read_lines(path):
        if row > last:
            break
        if row <= import_map.header_rows:
            continue
        count += 1
        if row < row_range.first:
            continue
        found += 1
        fields, read_one = _split(line, import_map)
        if len(fields) != end - begin:
            detail = f"{len(fields)} columns instead of {end - begin}"
            detail += _delimiter_hint(line, import_map, end - begin)
            damaged.append(DamagedRow(row, "with a wrong number of columns", detail))
            continue
        try:
            read = [read_one(fields[column]) for column in wanted]
        except _NO_NUMBER:
            read, bad = _read_with_gaps(fields, wanted, may_be_empty, read_one)
            if bad is not None:
                detail = f"{_describe(bad, fields[bad])} ({roles[bad]})"
                damaged.append(DamagedRow(row, "without a number", detail))
                continue
        if stamps is not None and time is not None:
            try:
                stamps.append(fields, read_one)
            except _NO_NUMBER:
                text = ", ".join(
                    _describe(each, fields[each]) for each in map(numbered, time.columns)
                )
                damaged.append(DamagedRow(row, "without a time stamp", text))
                continue
        numbers.extend(read)
        rows.append(row)
        counts.append(count)
    last_requested = row_range.last or row_range.first
    if row < last_requested and row_range != RowRange():
        raise ConfigError(
            f"{path}: has {row} rows, but rows up to {last_requested} are requested:"
            " correct --rows or `rows` in the map",
            code="RID-IMPORT-RANGE",
        )
    values = np.full((len(rows), len(columns)), np.nan)
    values[:, here] = np.frombuffer(numbers, dtype=np.float64).reshape(len(rows), len(wanted))
    if stamps is None:
        time_s, origin = (np.array(counts, dtype=float) - 1.0) / (import_map.rate_hz or math.nan), 0
    else:
        time_s, origin = stamps.seconds(origin_ns)
    table = ImportTable(np.array(rows, dtype=np.int64), time_s, values, found, origin_ns=origin)
    if not merged:
        return table
    needed = [i for i in here if np.isfinite(values[:, i]).any() or columns[i] not in optional]
    names = [roles[columns[i] - begin] for i in needed]
    try:
        return merge_topics(table, needed, names, damaged)
    except DataQualityError as error:
        raise DataQualityError(f"{path}: {error}", code=error.refusal) from None


def _split(line: str, import_map: ImportMap) -> tuple[list[str], Callable[[str], float]]:
    """Return the fields of a line, and the function that converts a field to a number."""
    separator, comma = SEPARATORS[import_map.delimiter], import_map.decimal == ","
    odd = "_" in line or not line.isascii() or (comma and "." in line)
    if separator == "," and comma and '"' not in line:
        return [], float  # without quotes, a decimal comma looks like a delimiter
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
        if permitted and not fields[column].strip():
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
    """Return a column and its text for a message."""
    words = text.strip()[:40]
    return f"column {column} is {words!r}" if words else f"column {column} is empty"


def _append_columns(
    first: ImportTable, other: ImportTable, path: Path, damaged: list[DamagedRow]
) -> ImportTable:
    """Add the columns of another file to a table, interpolated to its stamps."""
    sound = np.isfinite(other.time_s)
    sound[sound] = ~np.logical_or(*find_unordered(other.time_s[sound]))
    stamps, read = other.time_s[sound], other.values[sound]
    notes = first.notes
    if len(stamps) < other.rows_read:
        lost = other.rows_read - len(stamps)
        notes += (
            f"{path.name}: {lost} of {other.rows_read} rows cannot be read or are out of time"
            " order; their values are interpolated from the rows around them",
        )
    if len(stamps) < 2:
        raise ConfigError(
            f"{path}: contains {len(stamps)} readable rows, but at least 2 are needed: check that"
            " file and map belong together",
            code="RID-IMPORT-ROWS",
        )
    near = rows_near(stamps, first.time_s)
    reason = f"without a row in {path.name} near its time"
    damaged.extend(
        DamagedRow(int(row), reason, f"its time stamp is {stamp:.9g} s")
        for row, stamp in zip(first.row[~near], first.time_s[~near], strict=True)
    )
    values = first.values[near]
    for column in np.flatnonzero(np.isfinite(read).any(axis=0)):
        values[:, column] = np.interp(first.time_s[near], stamps, read[:, column])
    return replace(
        first, row=first.row[near], time_s=first.time_s[near], values=values, notes=notes
    )


def _delimiter_hint(line: str, import_map: ImportMap, columns: int) -> str:
    """Return a hint if another delimiter would give the right number of columns."""
    if import_map.decimal == import_map.delimiter and '"' not in line:
        return "; decimal and delimiter are both ',', so numbers must be quoted"
    for name, separator in SEPARATORS.items():
        if name != import_map.delimiter and len(line.split(separator)) == columns:
            return f"; with `delimiter: {name!r}` in the map, it has {columns} columns"
    return ""
