"""`PaceKeeper`: conversion of simulated time to wall-clock time, with a limited pace."""

from __future__ import annotations

from typing import Final

CATCHES_UP_NS: Final = 50_000_000


class PaceKeeper:
    """Converts simulated time to the wall-clock time at which it may be reached.

    After a delay of up to `CATCHES_UP_NS`, simulated time runs faster until it has caught up, so
    that the average pace is kept. A longer delay is not caught up: time continues at the normal
    pace.

    Args:
        rate: Pace: simulated seconds per second; None for no limit.
    """

    def __init__(self, rate: float | None) -> None:
        self._rate = rate
        self._wall_ns = self._simulated_ns = 0

    def begin(self, wall_ns: int, simulated_ns: int) -> None:
        """Start at a simulated time [ns] that corresponds to a time on CLOCK_MONOTONIC [ns]."""
        self._wall_ns, self._simulated_ns = wall_ns, simulated_ns

    def wall_ns(self, simulated_ns: int, now_ns: int) -> int:
        """Return the time on CLOCK_MONOTONIC that corresponds to a simulated time [ns].

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
