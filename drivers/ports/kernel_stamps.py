"""`KernelStamps`: a kernel's time stamps of frames, which are dates, put on CLOCK_MONOTONIC."""

from __future__ import annotations

import time

APART_NS = 20_000
"""How far apart two readings of clocks may be to be of one moment [ns]."""

_TRIES = 5


def both_clocks() -> tuple[int, int]:
    """Return CLOCK_REALTIME and CLOCK_MONOTONIC of one moment [ns]."""
    for _ in range(_TRIES):
        before_ns = time.monotonic_ns()
        date_ns, now_ns = time.time_ns(), time.monotonic_ns()
        if now_ns - before_ns < APART_NS:
            return date_ns, now_ns
    return time.time_ns(), time.monotonic_ns()


class KernelStamps:
    """When frames arrived, on CLOCK_MONOTONIC, whatever is done to the date.

    The two clocks run alike, slewed or not, until the date is set. A frame that is read came after
    all before it were read, and was stamped by the date as it was then or as it is now: that tells
    which. Where the date was set by less than the time between, it does not, and the frame may be
    wrong by as much.

    Parameters
    ----------
    date_ns, now_ns
        CLOCK_REALTIME and CLOCK_MONOTONIC [ns], as in `look`.
    """

    def __init__(self, date_ns: int, now_ns: int) -> None:
        self._last_ns = self._now_ns = now_ns
        self._ahead_ns = self._was_ahead_ns = date_ns - now_ns

    def look(self, date_ns: int, now_ns: int) -> None:
        """Take both clocks, just before frames are read [ns]."""
        self._was_ahead_ns, self._ahead_ns = self._ahead_ns, date_ns - now_ns
        self._now_ns = now_ns

    def arrival_s(self, stamp_ns: int) -> float:
        """Return when a frame that has just been read arrived [s]."""
        last_ns, now_ns = self._last_ns, self._now_ns
        arrived_ns = stamp_ns - self._ahead_ns
        if not last_ns <= arrived_ns <= now_ns:
            by_the_date_before_ns = stamp_ns - self._was_ahead_ns
            if last_ns <= by_the_date_before_ns <= now_ns:
                arrived_ns = by_the_date_before_ns
        return min(max(arrived_ns, last_ns), now_ns) * 1e-9

    def all_read(self) -> None:
        """Note that nothing that came before the look waits any more."""
        self._last_ns = self._now_ns
