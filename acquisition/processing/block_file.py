"""`BlockFile`: numbered arrays of equal shape, on disk instead of in memory."""

from __future__ import annotations

import os
import tempfile
import weakref
from collections.abc import Iterator

import numpy as np

from config.arrays import FloatArray
from config.errors import RecordingError


class BlockFile:
    """Arrays in an unnamed file, which disappears with this object.

    Args:
        shape: Rows and columns of each array.

    Raises:
        RecordingError: There is no space for temporary files; storing an array can also raise this
            error.
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self.shape = shape
        self._bytes = 8 * shape[0] * shape[1]
        self._places: dict[int, int] = {}
        try:
            self._file, name = tempfile.mkstemp(prefix="rid-daq-")
            os.unlink(name)
        except OSError as error:
            raise _no_room(error.strerror) from error
        weakref.finalize(self, os.close, self._file)

    def __iter__(self) -> Iterator[int]:
        return iter(self._places)

    def __getitem__(self, number: int) -> FloatArray:
        """Return an array by its number; zeros if it was never set."""
        return self.rows(number, slice(None))

    def rows(self, number: int, rows: slice) -> FloatArray:
        """Return consecutive rows of an array; only these rows are read from the file."""
        first, end, _ = rows.indices(self.shape[0])
        if number not in self._places:
            return np.zeros((end - first, self.shape[1]))
        row = self._bytes // self.shape[0]
        begin = self._places[number] * self._bytes + first * row
        data = os.pread(self._file, (end - first) * row, begin)
        return np.frombuffer(data).reshape(-1, self.shape[1]).copy()

    def __setitem__(self, number: int, values: FloatArray) -> None:
        place = self._places.setdefault(number, len(self._places))
        try:
            written = os.pwrite(self._file, values.tobytes(), place * self._bytes)
        except OSError as error:
            raise _no_room(error.strerror) from error
        if written < self._bytes:
            raise _no_room("the disk is full")


def _no_room(reason: str | None) -> RecordingError:
    return RecordingError(
        f"{tempfile.gettempdir()}: no space for the periods of a recording ({reason}); free disk"
        " space, or set TMPDIR to another folder",
        code="RID-SYSTEM-DISK-FULL",
    )
