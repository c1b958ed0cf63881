"""`Ring`: rows from the cyclic task to the recorder, through shared memory, without a lock.

One process writes and one reads. Each counter has one writer and is stored with one aligned 64-bit
store after the bytes that it announces, so no lock is needed (on x86-64, whose stores stay in
order). The memory is anonymous: it has no name that could outlive a killed process.
"""

from __future__ import annotations

from collections.abc import Callable
from multiprocessing import get_context
from typing import Any

from acquisition.journal.cycle_row import row_struct
from config.errors import RecordingError

_WRITTEN, _READ = 0, 8  # 64-bit words, each in a cache line of its own
_HEADER_BYTES = 128


class Ring:
    """Rows in shared memory; made by `create`, handed to the processes as an argument.

    Parameters
    ----------
    memory : ctypes array
        Shared memory of `_HEADER_BYTES` and `capacity` rows.
    joints : int
        Joints in a row.
    capacity : int
        Rows that fit.
    """

    def __init__(self, memory: Any, joints: int, capacity: int) -> None:
        self._memory = memory
        self.joints = joints
        self.capacity = capacity
        layout = row_struct(joints)
        self.row_size = layout.size
        view = memoryview(memory).cast("B")
        self._counters = view[:_HEADER_BYTES].cast("q")
        self._rows = view[_HEADER_BYTES:]
        self._pack_into = layout.pack_into

    @classmethod
    def create(cls, joints: int, capacity: int) -> Ring:
        """Return an empty ring in fresh shared memory."""
        if capacity < 1:
            raise RecordingError(f"ring: capacity {capacity} rows; give 1 or more")
        size = _HEADER_BYTES + capacity * row_struct(joints).size
        return cls(get_context("spawn").RawArray("B", size), joints, capacity)

    def __reduce__(self) -> tuple[Callable[..., Ring], tuple[Any, int, int]]:
        return Ring, (self._memory, self.joints, self.capacity)

    @property
    def written(self) -> int:
        """Rows written since the start."""
        return self._counters[_WRITTEN]

    @property
    def waiting(self) -> int:
        """Rows written and not read yet."""
        return self._counters[_WRITTEN] - self._counters[_READ]

    @property
    def fill(self) -> float:
        """Part of the ring that waits to be read, 0 to 1."""
        return self.waiting / self.capacity

    def write(self, values: tuple[Any, ...]) -> bool:
        """Write one row; the writer's side.

        Parameters
        ----------
        values : tuple
            The row's fields in the order of `row_dtype`, arrays spread out.

        Returns
        -------
        bool
            False where the ring is full: the row is not written and nothing is overwritten.
        """
        counters = self._counters
        written = counters[_WRITTEN]
        if written - counters[_READ] >= self.capacity:
            return False
        self._pack_into(self._rows, written % self.capacity * self.row_size, *values)
        counters[_WRITTEN] = written + 1
        return True

    def read(self, limit: int = 4096) -> bytes:
        """Take up to `limit` waiting rows; the reader's side.

        Returns
        -------
        bytes
            Whole rows, oldest first; empty where none waits.
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
        """Return up to `limit` of the rows last written, without taking them; for observers.

        Returns
        -------
        bytes
            Whole rows, oldest first; empty where there is none, or where the writer came round
            while they were copied.
        """
        counters = self._counters
        end = counters[_WRITTEN]
        start = max(0, end - min(limit, self.capacity - 1))
        first, last = start % self.capacity, end % self.capacity
        size = self.row_size
        if first <= last:
            rows = bytes(self._rows[first * size : last * size])
        else:
            rows = bytes(self._rows[first * size :]) + bytes(self._rows[: last * size])
        return rows if counters[_WRITTEN] - start < self.capacity else b""
