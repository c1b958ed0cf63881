"""`SerialLine`: transmission times on a serial line, and arrival times at the computer.

A byte takes ten bit times. The computer polls its serial adapter at irregular times and gets all
bytes since the last poll. Bytes therefore arrive in groups, slightly late, and in order.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Vector = NDArray[np.float64]

BITS_PER_BYTE = 10
_SHORTEST_FRACTION = 0.2  # shortest time between two polls, relative to the longest


class SerialLine:
    """One direction of a serial line.

    Args:
        baud_rate: Baud rate [bit/s].
        jitter_s: Longest time between two polls of the adapter [s]; 0 for an adapter without delay.
        seed: Random seed of the times between polls.

    Attributes:
        free_s: Time at which the transmission of the last byte ends [s].
    """

    def __init__(self, baud_rate: int, jitter_s: float, seed: int) -> None:
        self._byte_s = BITS_PER_BYTE / baud_rate
        self._jitter_s = jitter_s
        self._random = np.random.default_rng(seed)
        self._poll_s = -math.inf
        self._stalled_s = -math.inf
        self.free_s = -math.inf

    def send(self, ready_s: ArrayLike, size: ArrayLike) -> Vector:
        """Send pieces of bytes one after the other; return their arrival times.

        Args:
            ready_s: Shape (n,). Earliest time at which each piece can be sent [s], not decreasing.
            size: Shape (n,). Sizes of the pieces [bytes].

        Returns:
            Shape (n,). Arrival time of each piece [s].
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
        return self._next_polls(arrived) if self._jitter_s > 0.0 else arrived

    def stall(self, until_s: float) -> None:
        """Delay all bytes that follow, so that no byte arrives before `until_s` [s]."""
        self._stalled_s = max(self._stalled_s, until_s)

    def _next_polls(self, arrived: Vector) -> Vector:
        """Return the time of the first poll at or after each arrival."""
        polls = [self._poll_s]
        if polls[-1] < arrived[0] - self._jitter_s:
            polls.append(arrived[0] - self._jitter_s * self._random.random())
        while polls[-1] < arrived[-1]:
            fraction = _SHORTEST_FRACTION + (1.0 - _SHORTEST_FRACTION) * self._random.random()
            polls.append(polls[-1] + fraction * self._jitter_s)
        times = np.array(polls)
        self._poll_s = float(times[-1])
        found: Vector = times[np.searchsorted(times, arrived)]
        return found
