"""`Clock`: the time base of a link's deadlines, the computer's or a simulated bus's."""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Callable
from typing import Final, Protocol

EARLY: Final = 0.1
"""Fraction of wake-ups of `MonotonicClock` that come early, after which it waits actively."""

STEP_S: Final = 2e-6
"""Largest change of the estimated wake-up delay by one wake-up [s]."""

MOST_WAKING_S: Final = 100e-6
"""Largest wake-up delay that `MonotonicClock` compensates [s]."""


class Clock(Protocol):
    """Time of the cell: the computer's, or in lock-step a simulated cell's."""

    @abstractmethod
    def now_s(self) -> float:
        """Return the time since an arbitrary start [s]; never runs backwards."""

    @abstractmethod
    def sleep_until(self, time_s: float) -> None:
        """Return at `time_s` or later, an absolute time of this clock [s]."""


class MonotonicClock:
    """The computer's monotonic clock, independent of changes of the date.

    A computer wakes a program with a delay that is nearly constant. `sleep_until` estimates this
    delay, sleeps for a shorter time, and waits actively for the rest, so that a cycle begins in
    time.

    Args:
        now_s, sleep: CLOCK_MONOTONIC [s], and a function that sleeps [s].
    """

    def __init__(
        self,
        now_s: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._now_s, self._sleep = now_s, sleep
        self._waking_s = 0.0

    def now_s(self) -> float:
        """Return CLOCK_MONOTONIC [s]."""
        return self._now_s()

    def sleep_until(self, time_s: float) -> None:
        """Sleep until an absolute deadline; return at once if it has passed."""
        left_s = time_s - self._now_s()
        slept = left_s > self._waking_s
        while left_s > self._waking_s:
            self._sleep(left_s - self._waking_s)
            left_s = time_s - self._now_s()
        if slept:
            self._update_delay(early=left_s > 0.0)
        while left_s > 0.0:
            left_s = time_s - self._now_s()

    def _update_delay(self, *, early: bool) -> None:
        """Track the quantile `EARLY` of the wake-up delay."""
        step_s = (EARLY - early) * STEP_S
        self._waking_s = min(max(self._waking_s + step_s, 0.0), MOST_WAKING_S)
