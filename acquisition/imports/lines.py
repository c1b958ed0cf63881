"""`read_lines`: yields the lines of a text file, of any Unicode encoding."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from config.errors import ConfigError, system_errors
from config.formats.bounded_file import open_file

LARGEST_FILE_BYTES = 500_000_000
SEPARATORS = {",": ",", ";": ";", "tab": "\t", "space": None}
"""Values of `delimiter` in an import map, and the arguments of `str.split` for them."""
DECIMAL_COMMA: Final = re.compile(r"[-+]?\d*,\d+([eE][-+]?\d+)?")
"""A number with a decimal comma."""


def split_cells(line: str, separator: str | None) -> list[str]:
    """Return the cells of a line, without a comment mark at its beginning (`# time`).

    Raises:
        csv.Error: A quoted cell is not closed or too long.
    """
    line = line.rstrip("\r\n")
    if line.lstrip().startswith(("#", "%")):
        line = line.lstrip().lstrip("#%").lstrip(" ")
    if separator is None:
        return line.split()
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]


def read_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the non-empty lines with their numbers, from 1.

    Raises:
        ConfigError: The file cannot be read, or is too large.
    """
    with (
        system_errors(ConfigError, f"cannot read {path}", code="RID-FILE-READ"),
        open_file(path, LARGEST_FILE_BYTES) as file,
    ):
        mark = file.read(2)
        file.seek(0)
        encoding = "utf-16" if mark in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
        text = io.TextIOWrapper(file, encoding, errors="replace")
        yield from ((row, line) for row, line in enumerate(text, start=1) if line.strip())
