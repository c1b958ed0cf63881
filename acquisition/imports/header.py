"""`number_columns`: replaces the names of columns in an import map by their numbers."""

from __future__ import annotations

import csv
import difflib
from collections.abc import Sequence
from pathlib import Path

from acquisition.imports.lines import SEPARATORS, read_lines, split_cells
from acquisition.maps.import_joint import COLUMN_QUANTITIES
from acquisition.maps.import_map import ImportMap
from acquisition.maps.time_column import Column, TimeColumn
from config.errors import ConfigError


def require_number_of_files(files: Sequence[Path], import_map: ImportMap) -> None:
    """Raise `ConfigError` if a map reads another number of files."""
    expected = 1 + len(import_map.further_files)
    if len(files) != expected:
        raise ConfigError(
            f"map {import_map.name!r} reads {expected} files, but {len(files)} are given: name"
            " them in the order of the map",
            code="RID-IMPORT-FILES",
        )


def number_columns(import_map: ImportMap, files: Sequence[Path]) -> ImportMap:
    """Return a map whose columns are numbers; names are looked up in the headers of the files.

    A name of a joint's or plate's column is looked up in all files, and the time stamps of a file
    in its own header. A comment mark before the first name (`# time`) is ignored.

    Args:
        import_map: Map with names or numbers.
        files: The first file, then the `further_files` of the map.

    Raises:
        ConfigError: The number of files differs from the map's, a file has no header or another
            number of columns, a name belongs to no column or to several, or a column has two roles.
    """
    require_number_of_files(files, import_map)
    by_name = [
        column
        for column in (*import_map.time_columns, *import_map.column_roles)
        if isinstance(column, str)
    ]
    if not by_name and None not in import_map.widths:
        return import_map
    if not import_map.header_rows:
        raise ConfigError(
            f"{files[0]}: map {import_map.name!r} names column {by_name[0]!r}, but header_rows is"
            " 0: set header_rows to the number of rows before the first row of numbers",
            code="RID-IMPORT-HEADER",
        )
    headers = [_read_header(file, import_map) for file in files]
    for file, header, width in zip(files, headers, import_map.widths, strict=True):
        if width not in (None, len(header)):
            raise ConfigError(
                f"{file} row {import_map.header_rows}: the header has {len(header)} columns, but"
                f" `columns` of map {import_map.name!r} is {width}: correct `columns`, header_rows"
                " or delimiter",
                code="RID-IMPORT-HEADER",
            )
    return with_numbers(import_map, headers, files)


def with_numbers(
    import_map: ImportMap, headers: Sequence[Sequence[str]], files: Sequence[Path]
) -> ImportMap:
    """Return a map with numbers instead of names; `headers` are the column names of each file.

    Raises:
        ConfigError: A name belongs to no column or to several, or a column has two roles.
    """
    names = [(file, name) for file, header in zip(files, headers, strict=True) for name in header]
    joints = tuple(
        joint.model_copy(
            update={
                quantity: _number(names, getattr(joint, quantity))
                for quantity in COLUMN_QUANTITIES
                if getattr(joint, quantity) is not None
            }
        )
        for joint in import_map.joints
    )
    times = [
        _number_time([(file, name) for name in header], import_map.time_column_of_file(number))
        for number, (file, header) in enumerate(zip(files, headers, strict=True))
    ]
    further = tuple(
        further.model_copy(update={"columns": len(header), "time": time})
        for further, header, time in zip(
            import_map.further_files, headers[1:], times[1:], strict=True
        )
    )
    plate = import_map.plate
    if plate is not None:
        columns = tuple(_number(names, column) for column in plate.columns)
        plate = plate.model_copy(update={plate.column_key: columns})
    numbered = import_map.model_copy(
        update={
            "columns": len(headers[0]),
            "time": times[0],
            "further_files": further,
            "joints": joints,
            "plate": plate,
        }
    )
    try:
        numbered.check_numbers()
    except ValueError as error:
        raise ConfigError(
            f"{files[0]}: map {import_map.name!r}: {error}", code="RID-IMPORT-HEADER"
        ) from None
    return numbered


def _read_header(file: Path, import_map: ImportMap) -> list[str]:
    """Return the names in the last of the header rows.

    A separator after the last name is ignored if the next row has none.
    """
    names: list[str] | None = None
    for row, line in read_lines(file):
        if row < import_map.header_rows:
            continue
        if row > import_map.header_rows and names is None:
            break
        try:
            cells = split_cells(line, SEPARATORS[import_map.delimiter])
        except csv.Error as error:
            if names is not None:
                break
            raise ConfigError(
                f"{file} row {row}: cannot be read as a header ({error}): correct header_rows"
                " or delimiter",
                code="RID-IMPORT-HEADER",
            ) from None
        if names is not None:
            return names[:-1] if not names[-1] and len(cells) == len(names) - 1 else names
        names = [name.strip('"') for name in cells]
    if names is not None:
        return names
    raise ConfigError(
        f"{file} row {import_map.header_rows}: is empty or missing, but header_rows of map"
        f" {import_map.name!r} says that it is the header: correct header_rows",
        code="RID-IMPORT-HEADER",
    )


def _number_time(names: list[tuple[Path, str]], time: TimeColumn | None) -> TimeColumn | None:
    if time is None:
        return None
    nanoseconds = None if time.nanoseconds is None else _number(names, time.nanoseconds)
    return time.model_copy(
        update={"column": _number(names, time.column), "nanoseconds": nanoseconds}
    )


def _number(names: list[tuple[Path, str]], column: Column) -> int:
    """Return the number of a column in the headers of all files."""
    if isinstance(column, int):
        return column
    found = [number for number, (_, name) in enumerate(names) if name == column]
    if len(found) == 1:
        return found[0]
    files = " and ".join(dict.fromkeys(str(file) for file, _ in names))
    if found:
        raise ConfigError(
            f"{files}: {len(found)} columns are named {column!r}: give the number of the one that"
            f" you mean, counted from 0 through all files ({', '.join(map(str, found))})",
            code="RID-IMPORT-HEADER",
        )
    known = [name for _, name in names]
    near = difflib.get_close_matches(column, known, 3, 0.5)
    hint = f"similar names are {', '.join(near)}" if near else f"names are {_few(known)}"
    raise ConfigError(
        f"{files}: no column is named {column!r}; {hint}: correct the map",
        code="RID-IMPORT-HEADER",
    )


def _few(names: Sequence[str]) -> str:
    return ", ".join(names[:10]) + (", …" if len(names) > 10 else "")
