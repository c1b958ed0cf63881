"""`PointRing`: points of a path on their way to the cyclic task, in shared memory without locks.

One process writes (reader of a file, thread of an iterator, socket server), one reads. Each counter
has one writer and is stored with one aligned 64-bit store after the data it announces, as in
`acquisition.task.ring`. A full ring accepts nothing, so the writer must wait: back-pressure.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from multiprocessing import get_context
from typing import Any, Final

import numpy as np

from config.arrays import FloatArray, IntArray
from config.errors import ConfigError

WRITTEN: Final = 0  # positions of the counters, each in its own cache line
READ: Final = 8
TOTAL: Final = 16
FAILED: Final = 24
CONCLUDED: Final = 32
_WORDS, _TEXT_BYTES = 40, 1024
_HEADER_BYTES = 8 * _WORDS + 2 * _TEXT_BYTES


class PointsFailed(IntEnum):
    """Reasons why no more points will arrive although the path's end was not announced."""

    NO = 0
    LOST = 1
    REFUSED = 2


class PointRing:
    """Rows of joint positions in shared memory; `create` makes them, and processes receive them.

    Args:
        memory: Shared memory of the header and `capacity` rows.
        joints: Joints per point.
        capacity: Largest number of points in the ring.
    """

    def __init__(self, memory: Any, joints: int, capacity: int) -> None:
        self._memory = memory
        self.joints = joints
        self.capacity = capacity
        view = memoryview(memory).cast("B")
        self.counters: IntArray = np.frombuffer(view, dtype=np.int64, count=_WORDS)
        self._text = view[8 * _WORDS : 8 * _WORDS + _TEXT_BYTES]
        self._verdict = view[8 * _WORDS + _TEXT_BYTES : _HEADER_BYTES]
        rows = np.frombuffer(view, dtype=np.float64, offset=_HEADER_BYTES)
        self.rows: FloatArray = rows.reshape(capacity, joints)

    @classmethod
    def create(cls, joints: int, capacity: int) -> PointRing:
        """Return an empty ring in new shared memory.

        Raises:
            ConfigError: The ring would have no capacity.
        """
        if capacity < 1 or joints < 1:
            raise ConfigError(
                f"a buffer of {capacity} points of {joints} joints has no capacity",
                code="RID-INTERNAL-ERROR",
            )
        size = _HEADER_BYTES + 8 * capacity * joints
        ring = cls(get_context("spawn").RawArray("B", size), joints, capacity)
        ring.counters[TOTAL] = -1
        return ring

    def __reduce__(self) -> tuple[Callable[..., PointRing], tuple[Any, int, int]]:
        return PointRing, (self._memory, self.joints, self.capacity)

    @property
    def written(self) -> int:
        """Points written since the start."""
        return int(self.counters[WRITTEN])

    @property
    def room(self) -> int:
        """Number of points that can be written now."""
        return self.capacity - int(self.counters[WRITTEN] - self.counters[READ])

    @property
    def ended(self) -> bool:
        """True if the writer has announced the end."""
        return bool(self.counters[TOTAL] >= 0)

    @property
    def failed(self) -> PointsFailed:
        """Reason why no more points will arrive."""
        return PointsFailed(int(self.counters[FAILED]))

    @property
    def closed(self) -> bool:
        """True if no more points will arrive."""
        return self.ended or bool(self.counters[FAILED])

    @property
    def failure(self) -> str:
        """The reason in a sentence; empty without a failure."""
        return _read(self._text)

    @property
    def points_read(self) -> int:
        """Number of points that the reader has read since the start."""
        return int(self.counters[READ])

    @property
    def concluded(self) -> bool:
        """True if the motion is over."""
        return bool(self.counters[CONCLUDED])

    @property
    def verdict(self) -> str:
        """Reason why the motion ended early; empty if it reached its end."""
        return _read(self._verdict)

    def write(self, points: FloatArray) -> int:
        """Write as many points as fit, shape (points, joints); return the number written."""
        counters = self.counters
        written = int(counters[WRITTEN])
        count = min(len(points), self.capacity - (written - int(counters[READ])))
        first = written % self.capacity
        straight = min(count, self.capacity - first)
        self.rows[first : first + straight] = points[:straight]
        self.rows[: count - straight] = points[straight:count]
        counters[WRITTEN] = written + count
        return count

    def end(self) -> None:
        """Announce that the path ends with the last point written, at rest."""
        if not self.closed:
            self.counters[TOTAL] = self.counters[WRITTEN]

    def fail(self, why: PointsFailed, text: str) -> None:
        """Report that no more points will arrive although the path is incomplete."""
        if not self.closed:
            _write(self._text, text)
            self.counters[FAILED] = int(why)

    def conclude(self, verdict: str) -> None:
        """Report that the motion is over, with the reason if it ended early."""
        if not self.concluded:
            _write(self._verdict, verdict)
            self.counters[CONCLUDED] = 1


def _write(place: memoryview, text: str) -> None:
    clipped = text.encode().replace(b"\0", b"?")[: _TEXT_BYTES - 1]
    clipped = clipped.decode(errors="ignore").encode()
    place[: len(clipped)] = clipped


def _read(place: memoryview) -> str:
    return bytes(place).split(b"\0", 1)[0].decode(errors="replace")
