"""`read_lines`: yields the lines of a text file, of any Unicode encoding."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path

from config.errors import ConfigError, system_errors
from config.formats.bounded_file import open_file

LARGEST_FILE_BYTES = 500_000_000
SEPARATORS = {",": ",", ";": ";", "tab": "\t", "space": None}
"""Values of `delimiter` in an import map, and the arguments of `str.split` for them."""


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
