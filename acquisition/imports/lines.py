"""`read_lines`, `read_blocks`: yield the lines of a text file, of any Unicode encoding."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from config.errors import ConfigError, system_errors
from config.formats.bounded_file import BEGINNING_BYTES, encoding_of, open_file
from config.formats.file_kinds import kind_of_text

_JSON: Final = re.compile(rb'(\xef\xbb\xbf)?\s*(\{\s*"|\[\s*[{\[])')

LARGEST_FILE_BYTES = 4_000_000_000
BLOCK_CHARACTERS: Final = 1 << 19
SEPARATORS = {",": ",", ";": ";", "tab": "\t", "space": None}
"""Values of `delimiter` in an import map, and the arguments of `str.split` for them."""


MISSING: Final = frozenset(
    {"nan", "null", "none", "na", "n/a", "#n/a", "<na>", "-nan", "nan(ind)", "-nan(ind)"}
    | {"1.#qnan", "-1.#qnan", "1.#ind", "-1.#ind"}
)
"""Texts with which programs write a missing number, in lower case."""


def states_no_number(cell: str) -> bool:
    """Return True if a cell states that a number is missing; an empty cell is not meant."""
    return cell.strip().lower() in MISSING


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


def split_by_delimiters(line: str) -> dict[str, list[str]]:
    """Return the cells of a line for each delimiter that an import map can name.

    The list is empty for a delimiter with which the line cannot be split.
    """
    found: dict[str, list[str]] = {}
    for delimiter, separator in SEPARATORS.items():
        try:
            found[delimiter] = split_cells(line, separator)
        except csv.Error:
            found[delimiter] = []
    return found


def most_lines(path: Path) -> int:
    """Return the number of lines of a text file of any encoding, or a larger number.

    Raises:
        ConfigError: The file cannot be read, or is too large.
    """
    with (
        system_errors(ConfigError, f"cannot read {path}", code="RID-FILE-READ"),
        open_file(path, LARGEST_FILE_BYTES) as file,
    ):
        pieces = iter(lambda: file.read(BLOCK_CHARACTERS), b"")
        return 1 + sum(piece.count(b"\n") + piece.count(b"\r") for piece in pieces)


def read_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the non-empty lines with their numbers, from 1; errors as in `read_blocks`."""
    for first, text in read_blocks(path):
        yield from lines_of_block(first, text)


def lines_of_block(first: int, text: str) -> Iterator[tuple[int, str]]:
    """Yield the non-empty lines of a block with their numbers; `first` is the first number."""
    yield from ((row, line) for row, line in enumerate(io.StringIO(text), first) if line.strip())


def read_blocks(path: Path) -> Iterator[tuple[int, str]]:
    """Yield blocks of whole lines, each with the number of its first line, from 1.

    The lines end with a newline character; only the last line of the file may have none.

    Raises:
        ConfigError: The file cannot be read, is too large, or is not a text file.
    """
    with (
        system_errors(ConfigError, f"cannot read {path}", code="RID-FILE-READ"),
        open_file(path, LARGEST_FILE_BYTES) as file,
    ):
        beginning = file.read(BEGINNING_BYTES)
        file.seek(0)
        kind = kind_of_text(beginning, by_keys=False)
        if kind is None and _JSON.match(beginning):
            kind = "a JSON file"
        if kind is not None:
            raise ConfigError(
                f"{path} is {kind}, not a CSV file: unpack it or save it as CSV, or give it the"
                " file name extension of its kind",
                code="RID-IMPORT-FILES",
            )
        text = io.TextIOWrapper(file, encoding_of(beginning), errors="replace")
        row = 1
        while block := text.read(BLOCK_CHARACTERS):
            block += text.readline()
            yield row, block
            row += block.count("\n")
