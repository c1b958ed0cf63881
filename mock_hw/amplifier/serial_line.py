"""`SerialLine`: how long bytes take on a serial line, and when a computer gets to see them.

Ten bits a byte, one byte after the other. The adapter at the computer's end hands over what it has
when it is polled, at times of its own: bytes arrive in bunches, a little late, never out of order.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Vector = NDArray[np.float64]

BITS_PER_BYTE = 10
_SHORTEST_SHARE = 0.2  # of the longest time between two polls


class SerialLine:
    """One direction of a line.

    Args:
        baud_rate: Bits per second.
        jitter_s: The longest time between two polls of the adapter [s]; 0 for one that never waits.
        seed: Of the polls.

    Attributes:
        free_s: When the last byte so far has been sent [s].
    """

    def __init__(self, baud_rate: int, jitter_s: float, seed: int) -> None:
        self._byte_s = BITS_PER_BYTE / baud_rate
        self._jitter_s = jitter_s
        self._random = np.random.default_rng(seed)
        self._poll_s = -math.inf
        self._stalled_s = -math.inf
        self.free_s = -math.inf

    def send(self, ready_s: ArrayLike, size: ArrayLike) -> Vector:
        """Send units of bytes one after the other.

        Args:
            ready_s: Shape (n,). From when on each may be sent [s], not falling.
            size: Shape (n,). Their sizes [bytes].

        Returns:
            Shape (n,). When each has arrived [s].
        """
        ready = np.asarray(ready_s, dtype=np.float64)
        if not len(ready):
            return np.zeros(0)
        takes = np.asarray(size) * self._byte_s
        after = np.cumsum(takes)
        start = np.maximum.accumulate(np.maximum(ready, self.free_s) - (after - takes))
        sent = start + after
        self.free_s = float(sent[-1])
        arrived = np.maximum(sent, self._stalled_s)
        return self._polled(arrived) if self._jitter_s > 0.0 else arrived

    def stall(self, until_s: float) -> None:
        """Let nothing arrive before a time [s]."""
        self._stalled_s = max(self._stalled_s, until_s)

    def _polled(self, arrived: Vector) -> Vector:
        """Return the first poll at or after each arrival."""
        polls = [self._poll_s]
        if polls[-1] < arrived[0] - self._jitter_s:
            polls.append(arrived[0] - self._jitter_s * self._random.random())
        while polls[-1] < arrived[-1]:
            share = _SHORTEST_SHARE + (1.0 - _SHORTEST_SHARE) * self._random.random()
            polls.append(polls[-1] + share * self._jitter_s)
        times = np.array(polls)
        self._poll_s = float(times[-1])
        found: Vector = times[np.searchsorted(times, arrived)]
        return found
