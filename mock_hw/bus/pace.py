"""`PaceKeeper`: conversion of simulated time to wall-clock time at a given pace."""

from __future__ import annotations

from typing import Final

CATCHES_UP_NS: Final = 50_000_000


class PaceKeeper:
    """Converts simulated time to wall-clock time, at a number of simulated seconds per second.

    A delay of up to `CATCHES_UP_NS` is caught up, so that the pace is kept on average. After a
    longer delay, time continues from there at the normal pace.

    Args:
        rate: Simulated seconds per second; None for no limit.
    """

    def __init__(self, rate: float | None) -> None:
        self._rate = rate
        self._wall_ns = self._simulated_ns = 0

    def begin(self, wall_ns: int, simulated_ns: int) -> None:
        """Set the simulated time [ns] that corresponds to a time on CLOCK_MONOTONIC [ns]."""
        self._wall_ns, self._simulated_ns = wall_ns, simulated_ns

    def wall_ns(self, simulated_ns: int, now_ns: int) -> int:
        """Return the wall-clock time of a simulated time [ns].

        Args:
            now_ns: Present time on CLOCK_MONOTONIC [ns].
        """
        if self._rate is None:
            return now_ns
        due_ns = self._wall_ns + round((simulated_ns - self._simulated_ns) / self._rate)
        if now_ns - due_ns > CATCHES_UP_NS:
            self.begin(now_ns, simulated_ns)
            return now_ns
        return due_ns
