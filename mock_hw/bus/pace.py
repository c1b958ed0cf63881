"""`PaceKeeper`: when simulated time comes, on the wall clock."""

from __future__ import annotations

from typing import Final

CATCHES_UP_NS: Final = 50_000_000


class PaceKeeper:
    """So many simulated seconds a second, and later where somebody keeps them waiting.

    What is late by up to `CATCHES_UP_NS` is made up for, so that an even pace is kept. After a
    longer wait time goes on from there: nothing is hurried.

    Args:
        rate: Simulated seconds a second; None for as many as there can be.
    """

    def __init__(self, rate: float | None) -> None:
        self._rate = rate
        self._wall_ns = self._simulated_ns = 0

    def begin(self, wall_ns: int, simulated_ns: int) -> None:
        """Go on from a simulated time [ns] that is now, on CLOCK_MONOTONIC [ns]."""
        self._wall_ns, self._simulated_ns = wall_ns, simulated_ns

    def wall_ns(self, simulated_ns: int, now_ns: int) -> int:
        """Return when a simulated time [ns] comes, where it is `now_ns` on CLOCK_MONOTONIC [ns]."""
        if self._rate is None:
            return now_ns
        due_ns = self._wall_ns + round((simulated_ns - self._simulated_ns) / self._rate)
        if now_ns - due_ns > CATCHES_UP_NS:
            self.begin(now_ns, simulated_ns)
            return now_ns
        return due_ns
