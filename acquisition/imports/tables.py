"""`ImportTable`: rows of CSV files as numbers in their own units, at the first file's times."""

from __future__ import annotations

import io
import math
from array import array
from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition.imports.import_map import ImportMap, RowRange
from acquisition.imports.report import DamagedRow
from acquisition.processing.smoothing import GAP_STEPS
from config.arrays import BoolArray, FloatArray, IntArray
from config.errors import ConfigError, system_errors
from config.formats.bounded_file import open_file
from config.formats.number import parse_number

LARGEST_FILE_BYTES = 500_000_000
SEPARATORS = {",": ",", ";": ";", "tab": "\t", "space": None}
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}


@dataclass(frozen=True, eq=False)
class ImportTable:
    """Rows whose columns are numbers.

    Attributes:
        row: Shape (rows,). Line numbers in the first file, from 1.
        time_s: Shape (rows,). Time stamps, or row number divided by the rate [s].
        values: Shape (rows, columns). Requested columns, in the units of the files.
        rows_read: Number of rows with data, damaged ones included.
        notes: Problems of further files, one sentence each.
    """

    row: IntArray
    time_s: FloatArray
    values: FloatArray
    rows_read: int
    notes: tuple[str, ...] = ()


def read_tables(
    files: Sequence[Path],
    import_map: ImportMap,
    columns: Sequence[int],
    damaged: list[DamagedRow],
) -> ImportTable:
    """Read files with a map; rows that are not numbers are reported and left out.

    Args:
        files: The first file, then the `further_files` of the map.
        import_map: Layout of the files.
        columns: Requested columns, counted through all files.
        damaged: List to which the dropped rows are appended, as rows of the first file.

    Raises:
        ConfigError: The number of files differs from the map's, a file cannot be read, or it ends
            before the rows that the map requests.
    """
    expected = 1 + len(import_map.further_files)
    if len(files) != expected:
        raise ConfigError(
            f"map {import_map.name!r} reads {expected} files, but {len(files)} are given: name"
            " them in the order of the map",
            code="RID-IMPORT-FILES",
        )
    first = _read_file(files[0], import_map, 0, columns, damaged)
    for number, path in enumerate(files[1:], start=1):
        first = _append_columns(
            first, _read_file(path, import_map, number, columns, []), path, damaged
        )
    return first


def find_unordered(stamps: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Return the smallest set of rows to drop so that the time stamps increase.

    Args:
        stamps: Shape (rows,). Finite time stamps.

    Returns:
        `doubled, disordered`, shape (rows,): rows with the stamp of the previous row, and other
        rows.
    """
    doubled = np.zeros(len(stamps), dtype=np.bool_)
    doubled[1:] = stamps[1:] == stamps[:-1]
    if (np.diff(stamps[~doubled]) > 0.0).all():
        return doubled, np.zeros_like(doubled)
    disordered = ~doubled
    # Longest increasing subsequence: ends[k] is the last row of the best one of length k + 1.
    ends: list[int] = []
    end_stamps: list[float] = []
    before = np.full(len(stamps), -1)
    for row in np.flatnonzero(~doubled).tolist():
        stamp = float(stamps[row])
        length = bisect_left(end_stamps, stamp)
        before[row] = ends[length - 1] if length else -1
        ends[length : length + 1] = [row]
        end_stamps[length : length + 1] = [stamp]
    chain = ends[-1]
    while chain >= 0:
        disordered[chain] = False
        chain = int(before[chain])
    return doubled, disordered


def _read_file(
    path: Path,
    import_map: ImportMap,
    number: int,
    columns: Sequence[int],
    damaged: list[DamagedRow],
) -> ImportTable:
    """Read one file; columns of other files are NaN."""
    begin, end = import_map.first_columns[number : number + 2]
    time = import_map.time_column_of_file(number)
    here = [i for i, column in enumerate(columns) if begin <= column < end]
    wanted = [columns[i] - begin for i in here] + ([] if time is None else [time.column])
    separator = SEPARATORS[import_map.delimiter]
    asked = import_map.rows if number == 0 else RowRange()
    last = asked.last or math.inf
    numbers, rows, counts = array("d"), array("q"), array("q")
    count = found = row = 0
    for row, line in _lines(path):
        if row > last:
            break
        if row <= import_map.header_rows:
            continue
        count += 1
        if row < asked.first:
            continue
        found += 1
        odd = "_" in line or not line.isascii() or (import_map.decimal == "," and "." in line)
        if import_map.decimal == "," and not odd:
            line = line.replace(",", ".")
        fields = line.replace('"', "").split(separator)
        if len(fields) != end - begin:
            detail = f"{len(fields)} columns instead of {end - begin}"
            detail += _delimiter_hint(line, import_map.delimiter, end - begin)
            damaged.append(DamagedRow(row, "with a wrong number of columns", detail))
            continue
        read_one = _strict_parser(import_map.decimal) if odd else float
        try:
            numbers.extend([read_one(fields[column]) for column in wanted])
        except (ConfigError, ValueError):
            damaged.append(
                DamagedRow(row, "without a number", _describe_bad_field(fields, wanted, read_one))
            )
            continue
        rows.append(row)
        counts.append(count)
    if row < (asked.last or asked.first) and asked != RowRange():
        raise ConfigError(
            f"{path}: has {row} rows, but rows up to {asked.last or asked.first} are requested:"
            " correct --rows or `rows` in the map",
            code="RID-IMPORT-RANGE",
        )
    read = np.frombuffer(numbers, dtype=np.float64).reshape(-1, len(wanted))
    values = np.full((len(rows), len(columns)), np.nan)
    values[:, here] = read[:, : len(here)]
    if time is None:
        stamps = (np.array(counts, dtype=np.float64) - 1.0) / (import_map.rate_hz or math.nan)
    else:
        stamps = read[:, -1] * _SECONDS[time.unit]
    return ImportTable(np.array(rows, dtype=np.int64), stamps, values, found)


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the non-empty lines with their numbers."""
    with (
        system_errors(ConfigError, f"cannot read {path}", code="RID-FILE-READ"),
        open_file(path, LARGEST_FILE_BYTES) as file,
    ):
        mark = file.read(2)
        file.seek(0)
        encoding = "utf-16" if mark in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
        text = io.TextIOWrapper(file, encoding, errors="replace")
        yield from ((row, line) for row, line in enumerate(text, start=1) if line.strip())


def _strict_parser(decimal: str) -> Callable[[str], float]:
    """Return a parser for fields with more than plain digits: `1_5`, `1.234,5`."""

    def read(text: str) -> float:
        if decimal == ",":
            if "." in text:
                raise ConfigError(
                    "a decimal point in a number with a decimal comma", code="RID-FILE-NUMBER"
                )
            text = text.replace(",", ".")
        return parse_number(text)

    return read


def _describe_bad_field(fields: list[str], columns: list[int], read: Callable[[str], float]) -> str:
    for column in columns:
        try:
            read(fields[column])
        except (ConfigError, ValueError):
            return f"column {column} is {fields[column].strip()[:30]!r}"
    return "not a number"


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
            " order; the rows around them are used",
        )
    if len(stamps) < 2:
        raise ConfigError(
            f"{path}: contains fewer than 2 readable rows: wrong file or map",
            code="RID-IMPORT-ROWS",
        )
    after = np.clip(np.searchsorted(stamps, first.time_s), 1, len(stamps) - 1)
    step_s = float(np.median(np.diff(stamps)))
    inside = (first.time_s >= stamps[0] - step_s / 2) & (first.time_s <= stamps[-1] + step_s / 2)
    near = inside & (stamps[after] - stamps[after - 1] <= GAP_STEPS * step_s)
    damaged.extend(
        DamagedRow(int(row), f"without a row in {path.name} at its time", f"it is {stamp:.9g} s")
        for row, stamp in zip(first.row[~near], first.time_s[~near], strict=True)
    )
    values = first.values[near]
    for column in np.flatnonzero(np.isfinite(read).any(axis=0)):
        values[:, column] = np.interp(first.time_s[near], stamps, read[:, column])
    return ImportTable(first.row[near], first.time_s[near], values, first.rows_read, notes)


def _delimiter_hint(line: str, delimiter: str, columns: int) -> str:
    """Return a hint if another delimiter would give the right number of columns."""
    for name, separator in SEPARATORS.items():
        if name != delimiter and len(line.split(separator)) == columns:
            return f"; {columns} with `delimiter: {name!r}` in the map"
    return ""
