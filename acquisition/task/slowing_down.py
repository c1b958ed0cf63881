"""`SlowingDown`: whether every axis slows down on its quick stop as it must."""

from __future__ import annotations

import math
from collections.abc import Sequence

LOOK_S = 0.02
OBEY_S = 0.045
LEAST_SHARE = 0.5
SLACK = 0.1


class SlowingDown:
    """Whether every axis slows down as its quick stop must make it: at half the rate at least.

    Speeds are taken over some cycles, so that an encoder's increment is no speed. The first of them
    is what the axis had; where an axis was not seen, nothing is judged.

    Parameters
    ----------
    deceleration : float
        What the drives were told [rad/s² or m/s²].
    period_s : float
        The cycle time [s].
    position : sequence of float, length joints
        Where the axes are [rad or m].
    began_s : float
        When that was so [s].
    """

    def __init__(
        self, deceleration: float, period_s: float, position: Sequence[float], began_s: float
    ) -> None:
        self._least = LEAST_SHARE * deceleration
        self._cycles = math.ceil(LOOK_S / period_s)
        self._count = 0
        self._at = [(began_s, value) for value in position]
        self._first: list[tuple[float, float] | None] = [None] * len(position)

    def deaf(self, time_s: float, position: Sequence[float], received: Sequence[bool]) -> list[int]:
        """Return the axes that are too fast, by number, after one more cycle at `time_s` [s]."""
        self._count += 1
        if self._count % self._cycles:
            return []
        found = []
        for i, (now, answered) in enumerate(zip(position, received, strict=True)):
            then_s, then = self._at[i]
            if not answered or time_s <= then_s:
                continue
            self._at[i] = (time_s, now)
            speed = abs(now - then) / (time_s - then_s)
            first = self._first[i]
            if first is None:
                self._first[i] = (time_s, speed)
            elif time_s - first[0] >= OBEY_S:
                allowed = first[1] - self._least * (time_s - first[0])
                if speed > max(allowed, SLACK):
                    found.append(i)
        return found
