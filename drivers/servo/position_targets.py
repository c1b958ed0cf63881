"""`PositionTargets`: set-points of drives that follow positions, from the velocities of a motion.

A drive without a velocity mode gets the sum of its velocities, from where its axis was when it was
switched on. While it is not, its set-point is where it stands: power moves nothing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_WRAP = 1 << 32
_HALF = 1 << 31


class PositionTargets:
    """What the axes are told in a cycle, those by position and those by velocity together.

    Parameters
    ----------
    by_position : sequence of bool
        Which axes follow positions.
    cycle_time_s : float
        How long a set-point acts [s].
    """

    def __init__(self, by_position: Sequence[bool], cycle_time_s: float) -> None:
        self._by_position = tuple(by_position)
        self._cycle_time_s = cycle_time_s
        self._targets = [0.0] * len(self._by_position)

    def hold(self, counts: NDArray[np.int32], enabled: NDArray[np.bool_]) -> list[int]:
        """Return the set-points at rest: of an axis without power where it stands.

        Parameters
        ----------
        counts, enabled : ndarray, shape (axes,)
            6064h of the last answers, and whether the drive is in Operation Enabled.
        """
        for axis, (at, powered) in enumerate(zip(counts.tolist(), enabled.tolist(), strict=True)):
            if not powered:
                self._targets[axis] = float(at)
        return [
            _as_counter(target) if by_position else 0
            for target, by_position in zip(self._targets, self._by_position, strict=True)
        ]

    def follow(self, velocity: Sequence[int]) -> list[int]:
        """Return the set-points that velocities lead to, in 60FFh's units (here: counts/s)."""
        told = []
        for axis, (value, by_position) in enumerate(zip(velocity, self._by_position, strict=True)):
            self._targets[axis] += value * self._cycle_time_s
            told.append(_as_counter(self._targets[axis]) if by_position else value)
        return told


def _as_counter(counts: float) -> int:
    """Return a position as a counter of 32 bits has it."""
    return (round(counts) + _HALF) % _WRAP - _HALF
