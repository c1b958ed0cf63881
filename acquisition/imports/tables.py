"""`read_tables`: reads CSV files as numbers, interpolated to the times of the first file."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from acquisition.imports.lines import most_lines, read_blocks
from acquisition.imports.merged_topics import merge_topics, rows_near
from acquisition.imports.report import DamagedRow
from acquisition.imports.row_reader import RowReader
from acquisition.imports.table import ImportTable, find_unordered
from acquisition.maps.import_map import ImportMap, RowRange
from acquisition.maps.time_column import Stamps, numbered
from config.arrays import PIECE_ROWS
from config.column_file import ColumnFile, selected_rows
from config.errors import ConfigError, DataQualityError

Watch = Callable[[Path, float], None]
"""Function of the file that is being read, and of the fraction of its rows that has been read."""


def read_tables(
    files: Sequence[Path],
    import_map: ImportMap,
    columns: Sequence[int],
    damaged: list[DamagedRow],
    optional: Collection[int] = (),
    watch: Watch | None = None,
) -> ImportTable:
    """Read files with a map; rows that are not numbers are reported and left out.

    Args:
        files: The first file, then the `further_files` of the map.
        import_map: Layout of the files, without names of columns (`number_columns`).
        columns: Requested columns, counted through all files.
        damaged: List to which the dropped rows are appended, as rows of the first file.
        optional: Requested columns in which cells may be empty; an empty cell becomes NaN.
        watch: Function to call with the progress.

    Raises:
        ConfigError: A file cannot be read, ends before the rows that the map requests, or, as a
            further file, has fewer than two readable rows.
        DataQualityError: A column with empty cells has values in fewer than two rows.
    """
    first = read_table(files[0], import_map, 0, columns, damaged, optional, None, watch)
    for number, path in enumerate(files[1:], start=1):
        begin, end = import_map.first_columns[number : number + 2]
        if not any(begin <= column < end for column in columns):
            continue  # the file of a force plate
        origin = first.origin_ns
        other = read_table(path, import_map, number, columns, [], optional, origin, watch)
        first = _append_columns(first, other, path, damaged)
    return first


def read_table(
    path: Path,
    import_map: ImportMap,
    number: int,
    columns: Sequence[int],
    damaged: list[DamagedRow],
    optional: Collection[int],
    origin_ns: int | None,
    watch: Watch | None = None,
) -> ImportTable:
    """Read one file; the columns that belong to other files are NaN.

    Args:
        path: The file.
        import_map, columns, optional, watch: As for `read_tables`.
        number: Number of the file, from 0.
        damaged: List to which the dropped rows are appended, as rows of this file.
        origin_ns: Origin of the first file's time stamps [ns]; None for the first file.

    Raises:
        ConfigError: The file cannot be read, or it ends before the rows that the map requests.
        DataQualityError: A column with empty cells has values in fewer than two rows.
    """
    begin, end = import_map.first_columns[number : number + 2]
    time = import_map.time_column_of_file(number)
    stamps = None if time is None else Stamps(time)
    here = [i for i, column in enumerate(columns) if begin <= column < end]
    wanted = [columns[i] - begin for i in here]
    roles = {numbered(column) - begin: role for column, role in import_map.column_roles.items()}
    merged = import_map.empty_cells == "interpolate"
    may_be_empty = [merged or columns[i] in optional for i in here]
    row_range = import_map.rows if number == 0 else RowRange()
    most = most_lines(path)  # lines that another program appends from now on are not read
    last = min(row_range.last or math.inf, most)
    reader = RowReader(import_map, end - begin, wanted, may_be_empty, roles, stamps, damaged, most)
    for first, text in read_blocks(path):
        reader.add_block(first, text, row_range.first, last)
        if watch is not None:
            watch(path, reader.last_row / max(last, 1.0))
        if reader.last_row > last:
            break
    last_requested = row_range.last or row_range.first
    if reader.last_row < last_requested and row_range != RowRange():
        raise ConfigError(
            f"{path}: has {reader.last_row} rows, but rows up to {last_requested} are requested:"
            " correct --rows or `rows` in the map",
            code="RID-IMPORT-RANGE",
        )
    numbers = reader.numbers()
    if here == list(range(len(columns))):
        values = numbers
    else:
        file = ColumnFile(len(columns), len(numbers))
        for first in range(0, len(numbers), PIECE_ROWS):
            piece = numbers[first : first + PIECE_ROWS]
            wide = np.full((len(piece), len(columns)), np.nan)
            wide[:, here] = piece
            file.append(wide)
        values = file.table()
    if stamps is None:
        time_s, origin = (reader.counts() - 1.0) / (import_map.rate_hz or math.nan), 0
    else:
        time_s, origin = stamps.seconds(origin_ns)
    table = ImportTable(reader.rows(), time_s, values, reader.found, origin_ns=origin)
    if not merged:
        return table
    needed = [i for i in here if np.isfinite(values[:, i]).any() or columns[i] not in optional]
    names = [roles[columns[i] - begin] for i in needed]
    try:
        return merge_topics(table, needed, names, damaged)
    except DataQualityError as error:
        raise DataQualityError(f"{path}: {error}", code=error.refusal) from None


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
    reason = f"with no row of {path.name} near in time"
    damaged.extend(
        DamagedRow(int(row), reason, f"its time stamp is {stamp:.9g} s")
        for row, stamp in zip(first.row[~near], first.time_s[~near], strict=True)
    )
    values = selected_rows(first.values, near)
    for column in np.flatnonzero(np.isfinite(read).any(axis=0)):
        values[:, column] = np.interp(first.time_s[near], stamps, read[:, column])
    return replace(
        first, row=first.row[near], time_s=first.time_s[near], values=values, notes=notes
    )
