"""`ColumnFile`: columns of a long recording in a temporary file instead of in memory.

A column is contiguous in the file and is mapped as an ordinary array. `each_column` releases the
memory of each column before the next one, so that a computation needs the memory of one column.
"""

from __future__ import annotations

import mmap
import os
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import DTypeLike, NDArray

from config.arrays import PIECE_ROWS, BoolArray, FloatArray, release

FOLDER: Final = Path("/var/tmp")  # /tmp is often in memory


class ColumnFile:
    """Table of a known largest size, to which rows are appended.

    The file has no name, so that it disappears with the last array of it.

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
        folder = FOLDER if "TMPDIR" not in os.environ and os.access(FOLDER, os.W_OK) else None
        self._file = tempfile.TemporaryFile(dir=folder, buffering=0)  # noqa: SIM115
        # `truncate` reserves no space: on a full disk, `append` fails with an OSError
        self._file.truncate(max(columns * most_rows * self._dtype.itemsize, 1))

    def __del__(self) -> None:
        self._file.close()

    def append(self, values: NDArray[Any]) -> None:
        """Append rows, shape (rows, columns).

        Raises:
            OSError: The disk is full.
        """
        if self.rows + len(values) > self._most:
            raise ValueError(f"a table of at most {self._most} rows got more")
        for number, column in enumerate(values.T):
            self._write(number, column)
        self.rows += len(values)

    def _write(self, number: int, column: NDArray[Any]) -> None:
        """Write the next rows of one column."""
        place = (number * self._most + self.rows) * self._dtype.itemsize
        data = np.ascontiguousarray(column, self._dtype).data.cast("B")
        while data:
            written = os.pwrite(self._file.fileno(), data, place)
            data, place = data[written:], place + written

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
        mapped = mmap.mmap(self._file.fileno(), 0)
        whole = np.ndarray((self._columns, self._most), self._dtype, mapped)
        return whole[:, : self.rows].T


def selected_rows(values: NDArray[Any], mask: BoolArray) -> NDArray[Any]:
    """Return the rows of an array, shape (rows,) or (rows, columns), in a file."""
    table = values[:, np.newaxis] if values.ndim == 1 else values
    file = ColumnFile(table.shape[1], int(np.count_nonzero(mask)), values.dtype)
    for first in range(0, len(table), PIECE_ROWS):
        piece = slice(first, first + PIECE_ROWS)
        file.append(table[piece][mask[piece]])
        release(values)
    kept = file.table()
    return kept[:, 0] if values.ndim == 1 else kept


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
