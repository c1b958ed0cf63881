"""`ColumnFile`: columns of a long recording in a temporary file instead of in memory.

A small table stays in memory, because an open file for each table of many short runs could exceed
the limit of open files.

A column is contiguous in the file and is mapped as an ordinary array. `each_column` releases the
memory of each column before the next one, so that a computation needs the memory of one column.
"""

from __future__ import annotations

import errno
import mmap
import os
import tempfile
import weakref
from collections.abc import Callable, Iterable, Iterator, Sequence
from io import FileIO
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from config.arrays import PIECE_ROWS, BoolArray, FloatArray, is_mapped, lock, release

FOLDER: Final = Path("/var/tmp")  # /tmp is often in memory
MEMORY_BYTES: Final = 4_000_000
"""Largest size of a table that stays in memory."""


class ColumnFile:
    """Table of a known largest size, to which rows are appended.

    The file has no name, so that it disappears with the last array that views it.

    Args:
        columns: Number of columns.
        most_rows: Largest number of rows.
        dtype: Type of all values.

    Attributes:
        rows: Number of rows so far.
    """

    def __init__(self, columns: int, most_rows: int, dtype: DTypeLike = np.float64) -> None:
        self.rows = 0
        self._columns, self._most = columns, most_rows
        self._dtype = np.dtype(dtype)
        self._memory: NDArray[Any] | None = None
        size = columns * most_rows * self._dtype.itemsize
        if size <= MEMORY_BYTES:
            self._memory = np.empty((columns, most_rows), self._dtype)
            return
        self._file = _open_unnamed()
        weakref.finalize(self, self._file.close)
        self._file.truncate(size)  # reserves no space: on a full disk, `append` fails

    def append(self, values: NDArray[Any]) -> None:
        """Append rows, shape (rows, columns).

        Raises:
            OSError: The file cannot be written, for example on a full disk.
            IndexError: The table would have more than `most_rows` rows.
        """
        if self.rows + len(values) > self._most:
            raise IndexError(f"a table of at most {self._most} rows got more")
        for number, column in enumerate(values.T):
            self._write(number, column)
        self.rows += len(values)

    def _write(self, number: int, column: NDArray[Any]) -> None:
        """Write the next rows of one column."""
        if self._memory is not None:
            self._memory[number, self.rows : self.rows + len(column)] = column
            return
        first = (number * self._most + self.rows) * self._dtype.itemsize
        _write(self._file, np.ascontiguousarray(column, self._dtype), first)

    @classmethod
    def of_columns(cls, columns: Iterable[FloatArray], count: int, rows: int) -> FloatArray:
        """Return a table, shape (rows, count), of columns that are computed one by one."""
        file = cls(count, rows)
        for number, column in enumerate(columns):
            file._write(number, column)
        file.rows = rows
        return file.table()

    def table(self) -> NDArray[Any]:
        """Return the table, shape (rows, columns); a column is contiguous."""
        whole = self._memory
        if whole is None:
            mapped = mmap.mmap(self._file.fileno(), 0)
            whole = np.ndarray((self._columns, self._most), self._dtype, mapped)
        return whole[:, : self.rows].T


class ArrayPlace(NamedTuple):
    """Place of an array in an `ArrayFile`: its first byte and its shape."""

    first: int
    shape: tuple[int, ...]


class ArrayFile:
    """Arrays of any shape in a temporary file, each of which is read back as a whole.

    Attributes:
        size_bytes: Size of all arrays.
    """

    def __init__(self) -> None:
        self.size_bytes = 0
        self._file = _open_unnamed()
        weakref.finalize(self, self._file.close)

    def append(self, values: FloatArray) -> ArrayPlace:
        """Write an array, and return its place.

        Raises:
            OSError: The file cannot be written, for example on a full disk.
        """
        place = ArrayPlace(self.size_bytes, values.shape)
        _write(self._file, np.ascontiguousarray(values), place.first)
        self.size_bytes += values.nbytes
        return place

    def read(self, place: ArrayPlace) -> FloatArray:
        """Return the array at a place.

        Raises:
            OSError: The file cannot be read.
        """
        values = np.empty(place.shape)
        if os.preadv(self._file.fileno(), [values.data.cast("B")], place.first) < values.nbytes:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return values


def _open_unnamed() -> FileIO:
    """Open a file without a name, which disappears when it is closed and no longer mapped."""
    folder = FOLDER if "TMPDIR" not in os.environ and os.access(FOLDER, os.W_OK) else None
    return tempfile.TemporaryFile(dir=folder, buffering=0)


def _write(file: FileIO, values: NDArray[Any], first: int) -> None:
    """Write all bytes of a contiguous array from a byte of the file on."""
    data = values.data.cast("B")
    while data:
        written = os.pwrite(file.fileno(), data, first)
        data, first = data[written:], first + written


def selected_rows(values: NDArray[Any], mask: BoolArray) -> NDArray[Any]:
    """Return the rows where `mask` is True, as a `ColumnFile`; (rows,) or (rows, columns)."""
    table = values[:, np.newaxis] if values.ndim == 1 else values
    file = ColumnFile(table.shape[1], int(np.count_nonzero(mask)), values.dtype)
    for first in range(0, len(table), PIECE_ROWS):
        piece = slice(first, first + PIECE_ROWS)
        file.append(table[piece][mask[piece]])
        release(values)
    kept = file.table()
    return kept[:, 0] if values.ndim == 1 else kept


def stored(values: NDArray[Any]) -> NDArray[Any]:
    """Return a read-only array, (rows,) or (rows, columns), with the values in a `ColumnFile`."""
    return stored_rows([values])


def stored_rows(parts: Sequence[NDArray[Any]]) -> NDArray[Any]:
    """Return a read-only array of the rows of all parts, in a `ColumnFile`.

    A single part that is already mapped from a file is returned itself.
    """
    first = parts[0]
    if len(parts) == 1 and is_mapped(first):
        return lock(first)
    file = ColumnFile(first[:1].size, sum(map(len, parts)), first.dtype)
    for part in parts:
        for start in range(0, len(part), PIECE_ROWS):
            piece = part[start : start + PIECE_ROWS]
            file.append(piece.reshape(len(piece), -1))
            release(part)
    table = lock(file.table())
    return table[:, 0] if first.ndim == 1 else table


def stored_columns(function: Callable[[FloatArray], FloatArray], table: FloatArray) -> FloatArray:
    """Return a table of `function`, which keeps the number of rows, of each column of a table."""
    return ColumnFile.of_columns(map(function, each_column(table)), table.shape[1], len(table))


def each_column(table: FloatArray) -> Iterator[FloatArray]:
    """Yield the columns; the memory of each is released when the next one is requested."""
    for column in table.T:
        yield column
        release(table)


def has_few_values(column: FloatArray, few: int) -> bool:
    """Return True if a column has fewer than `few` different values."""
    values = np.empty(0)
    for first in range(0, len(column), PIECE_ROWS):
        values = np.unique(np.concatenate([values, column[first : first + PIECE_ROWS]]))
        if len(values) >= few:
            return False
    return True
