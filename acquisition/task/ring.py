"""`Ring`: lock-free ring of rows in shared memory, from the cyclic task to the recorder.

One process writes and one reads. Each counter has one writer and is stored with one aligned 64-bit
store after the bytes that it announces. Therefore no lock is needed on x86-64, which keeps stores
in order. The memory is freed when its last process ends. Another program of the same user can find
it, as it finds the control block, and read the latest rows without removing them.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from typing import Any

from acquisition.journal.cycle_row import row_struct
from acquisition.task.shared_memory import SharedMemory
from config.errors import RecordingError
from config.quantities import MOST_JOINTS

_LABEL = "rid-daq-ring-1"  # increase the number if the layout of header or row changes
_WRITTEN, _READ, _JOINTS, _CAPACITY, _MADE_NS = (
    0,
    8,
    16,
    17,
    18,
)  # indices of 64-bit words; they are in three different cache lines
_HEADER_BYTES = 192


class Ring:
    """Ring of rows in shared memory; `create` makes it, processes receive it as an argument.

    Args:
        memory: A header with the number of joints and rows, followed by the rows.

    Raises:
        RecordingError: Size and header of the memory do not match.
    """

    def __init__(self, memory: SharedMemory) -> None:
        self._memory = memory
        view = memoryview(memory.buffer)
        self._counters = view[:_HEADER_BYTES].cast("q")
        self.joints = self._counters[_JOINTS]
        self.capacity = self._counters[_CAPACITY]
        if not 1 <= self.joints <= MOST_JOINTS:
            raise RecordingError(
                f"ring: invalid number of joints {self.joints}: give 1 to {MOST_JOINTS}",
                code="RID-INTERNAL-ERROR",
            )
        layout = row_struct(self.joints)
        self.row_size = layout.size
        if self.capacity < 1 or len(view) != _HEADER_BYTES + self.capacity * self.row_size:
            raise RecordingError(
                f"ring: {len(view)} bytes do not match {self.capacity} rows",
                code="RID-INTERNAL-ERROR",
            )
        self._rows = view[_HEADER_BYTES:]
        self._pack_into = layout.pack_into

    @classmethod
    def create(cls, joints: int, capacity: int) -> Ring:
        """Return an empty ring in new shared memory.

        Raises:
            RecordingError: The capacity is below 1.
        """
        if capacity < 1:
            raise RecordingError(
                f"ring: invalid capacity {capacity} rows: give 1 or more", code="RID-INTERNAL-ERROR"
            )
        size = _HEADER_BYTES + capacity * row_struct(joints).size
        memory = SharedMemory.create(_LABEL, size)
        header = memoryview(memory.buffer)[:_HEADER_BYTES].cast("q")
        header[_JOINTS], header[_CAPACITY] = joints, capacity
        header[_MADE_NS] = time.monotonic_ns()
        return cls(memory)

    @classmethod
    def of_process(cls, pid: int) -> Ring | None:
        """Return the newest ring of another process, for reading; None without a ring.

        The ring shows its last rows as long as this object exists, even after the end of that
        process. Use only `latest` and the counters of such a ring: it cannot be written, and its
        rows cannot be removed.

        Raises:
            PermissionError: The process belongs to another user.
        """
        rings = []
        for memory in SharedMemory.of_process(pid, _LABEL, writable=False):
            with contextlib.suppress(RecordingError):  # the ring is still being created
                rings.append(cls(memory))
        return max(rings, key=lambda ring: ring._counters[_MADE_NS], default=None)

    def __reduce__(self) -> tuple[Callable[..., Ring], tuple[SharedMemory]]:
        return Ring, (self._memory,)

    @property
    def written(self) -> int:
        """Number of rows written since the start."""
        return self._counters[_WRITTEN]

    @property
    def waiting(self) -> int:
        """Number of rows that were written and not read yet."""
        return self._counters[_WRITTEN] - self._counters[_READ]

    @property
    def fill(self) -> float:
        """Fraction of the ring that waits to be read, 0 to 1."""
        return self.waiting / self.capacity

    def write(self, values: tuple[Any, ...]) -> bool:
        """Write one row; for the writing process only.

        Args:
            values: Fields of the row in the order of `row_dtype`, with arrays expanded.

        Returns:
            False if the ring is full: the row is not written and nothing is overwritten.
        """
        counters = self._counters
        written = counters[_WRITTEN]
        if written - counters[_READ] >= self.capacity:
            return False
        self._pack_into(self._rows, written % self.capacity * self.row_size, *values)
        counters[_WRITTEN] = written + 1
        return True

    def read(self, limit: int = 4096) -> bytes:
        """Return and remove up to `limit` waiting rows; for the reading process only.

        Returns:
            Whole rows, oldest first; empty if no row waits.
        """
        counters = self._counters
        start = counters[_READ]
        first = start % self.capacity
        count = min(counters[_WRITTEN] - start, limit, self.capacity - first)
        if count <= 0:
            return b""
        rows = bytes(self._rows[first * self.row_size : (first + count) * self.row_size])
        counters[_READ] = start + count
        return rows

    def latest(self, limit: int) -> bytes:
        """Return up to `limit` of the last written rows, without removing them; for observers.

        Returns:
            Whole rows, oldest first; empty if there is no row, or if the writer has overwritten
            them during the copy.
        """
        end = self._counters[_WRITTEN]
        return self._copy(max(0, end - min(limit, self.capacity - 1)), end)

    def rows_from(self, row: int) -> tuple[int, bytes]:
        """Return all rows from a row number on, without removing them; for observers.

        Args:
            row: Number of the first wanted row; the rows are numbered from 0.

        Returns:
            The number of the next row, and whole rows, oldest first. Rows that are older than half
            the ring are missing at the beginning: the writer may overwrite them during the copy.
        """
        end = self._counters[_WRITTEN]
        return end, self._copy(max(row, end - self.capacity // 2), end)

    def _copy(self, start: int, end: int) -> bytes:
        """Return rows by their numbers.

        Return nothing if the writer has overwritten them meanwhile.
        """
        if start >= end:
            return b""
        first, last = start % self.capacity, end % self.capacity
        size = self.row_size
        if first <= last:
            rows = bytes(self._rows[first * size : last * size])
        else:
            rows = bytes(self._rows[first * size :]) + bytes(self._rows[: last * size])
        return rows if self._counters[_WRITTEN] - start < self.capacity else b""
