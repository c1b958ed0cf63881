"""`write_array_tables`: writes arrays, or the fields of messages, as CSV files."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from acquisition.imports.header import require_number_of_files, with_numbers
from acquisition.maps.import_map import ImportMap
from acquisition.sources.array_files import (
    ARRAY_ENDINGS,
    Array,
    is_array_file,
    read_arrays,
    unread_names,
)
from acquisition.sources.bags import BAG_ENDINGS, is_bag
from acquisition.sources.message_files import read_message_arrays
from config.errors import ConfigError, system_errors

ROWS_AT_ONCE: Final = 10_000
_MOST_SHOWN: Final = 20


def has_named_arrays(path: Path) -> bool:
    """Return True if a path is a file of arrays, an MCAP file or a ROS bag."""
    return is_array_file(path) or is_bag(path)


def read_named_arrays(path: Path, names: Sequence[str] | None = None) -> dict[str, Array]:
    """Return the arrays in a file of arrays or messages; of messages only those with these names.

    Raises:
        ConfigError: The file cannot be read, or a library is not installed.
    """
    return read_arrays(path) if is_array_file(path) else read_message_arrays(path, names)


def write_array_tables(
    files: Sequence[Path], import_map: ImportMap, folder: Path
) -> tuple[tuple[Path, ...], ImportMap]:
    """Write the arrays that a map names as CSV files, one sample per row, with all digits.

    A column is an array of one dimension, or `name[k]`: column k of an array of two dimensions,
    counted from 0. The samples are along the dimension that has as many values as the time stamps;
    without time stamps, along the longest dimension of the joints' arrays.

    Args:
        files: The first file, then the `further_files` of the map.
        import_map: Map that gives all columns by name.
        folder: Folder for the CSV files.

    Returns:
        The CSV files, and the map that reads them.

    Raises:
        ConfigError: A file cannot be read or is not a file of arrays, the map gives a column by its
            number, or an array is missing or has the wrong shape.
    """
    require_number_of_files(files, import_map)
    for path in files:
        if not has_named_arrays(path):
            raise ConfigError(
                f"{path}: is not a file of arrays or messages"
                f" ({', '.join((*ARRAY_ENDINGS, *BAG_ENDINGS))}), but {files[0]} is: give files of"
                " one kind",
                code="RID-IMPORT-FILES",
            )
    names = [*import_map.time_columns, *import_map.column_roles]
    numbers = [column for column in names if isinstance(column, int)]
    if numbers:
        raise ConfigError(
            f"{files[0]}: map {import_map.name!r} gives column {numbers[0]} by its number, but the"
            " contents of this file have no order: give their names",
            code="RID-IMPORT-HEADER",
        )
    tables: list[Path] = []
    headers: list[list[str]] = []
    found: list[str] = []
    for number, path in enumerate(files):
        arrays = read_named_arrays(path, [str(name) for name in names])
        found += [f"{name} {array.shape}" for name, array in arrays.items()]
        columns = _columns(path, arrays, import_map, number)
        table = folder / str(number) / path.name  # errors in its rows then name the user's file
        table.parent.mkdir(exist_ok=True)
        _write_csv(table, columns)
        tables.append(table)
        headers.append(list(columns))
    missing = [name for name in names if not any(name in header for header in headers)]
    if missing:
        raise ConfigError(
            f"{' and '.join(map(str, files))}: nothing is named {missing[0]!r}; names found:"
            f" {', '.join(found[:_MOST_SHOWN]) or 'none'}: correct the map{objects_in(*files)}",
            code="RID-IMPORT-HEADER",
        )
    layout = with_numbers(import_map, headers, files)
    text_keys = {"header_rows": 0, "delimiter": ",", "decimal": "."}
    return tuple(tables), layout.model_copy(update=text_keys)


def objects_in(*files: Path) -> str:
    """Return the end of an error that names the contents of files that cannot be read, or ''."""
    names = [name for path in files if is_array_file(path) for name in unread_names(path)]
    if not names:
        return ""
    shown = ", ".join(names[:_MOST_SHOWN])
    return f". Not read, because they contain objects: {shown}. Save them as arrays of numbers"


def _columns(
    path: Path, arrays: Mapping[str, Array], import_map: ImportMap, number: int
) -> dict[str, Array]:
    """Return the columns of file `number` that the map names, all of equal length."""
    time = import_map.time_column_of_file(number)
    time_names = [] if time is None else [str(column) for column in time.columns]
    names = [*time_names, *(str(column) for column in import_map.column_roles)]
    named = {name: arrays[_split(name)[0]] for name in names if _split(name)[0] in arrays}
    longest = {name: max(array.shape, default=0) for name, array in named.items()}
    samples = max((longest[name] for name in time_names if name in named), default=0)
    samples = samples or max(longest.values(), default=0)
    columns: dict[str, Array] = {}
    for name, array in named.items():
        column = _column(name, array, samples)
        if column is None:
            raise ConfigError(
                f"{path}: array {name!r} has the shape {array.shape}, but there are {samples}"
                f" samples: name an array of {samples} values, or one column, such as"
                f" {_split(name)[0]}[0], of an array of {samples} rows",
                code="RID-IMPORT-HEADER",
            )
        columns[name] = column
    return columns


def _split(name: str) -> tuple[str, int | None]:
    """Return the array and the number of its column: `q[2]` is column 2 of `q`."""
    array, bracket, number = name.removesuffix("]").rpartition("[")
    if name.endswith("]") and bracket and number.isdecimal():
        return array, int(number)
    return name, None


def _column(name: str, array: Array, samples: int) -> Array | None:
    """Return a column of an array as a vector; None if its shape does not fit."""
    number = _split(name)[1]
    if number is None:
        return array.reshape(-1) if array.size == samples == max(array.shape, default=0) else None
    if array.ndim != 2:
        return None
    rows = array if array.shape[0] == samples else array.T
    return rows[:, number] if rows.shape[0] == samples and number < rows.shape[1] else None


def _write_csv(path: Path, columns: Mapping[str, Array]) -> None:
    with (
        system_errors(ConfigError, f"{path}: cannot be written", code="RID-FILE-WRITE"),
        path.open("w", encoding="utf-8", newline="") as file,
    ):
        for first in range(0, max(map(len, columns.values()), default=0), ROWS_AT_ONCE):
            rows = slice(first, first + ROWS_AT_ONCE)
            cells = [_cells(column[rows]) for column in columns.values()]
            csv.writer(file).writerows(zip(*cells, strict=True))


def _cells(column: Array) -> list[Any]:
    """Return values whose text has all digits; a number that is missing is an empty cell."""
    if column.dtype.kind == "f":
        numbers: list[float] = column.astype(np.float64).tolist()
        return ["" if math.isnan(number) else number for number in numbers]
    values: list[Any] = (column.astype(int) if column.dtype.kind == "b" else column).tolist()
    return values
