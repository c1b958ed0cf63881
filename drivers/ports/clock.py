"""`Clock`: clock for the deadlines of a bus or port; that of the computer or of a simulated bus."""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Callable
from typing import Final, Protocol

EARLY: Final = 0.1
"""Fraction of sleeps from which `MonotonicClock` wakes before the deadline and then waits actively.
The estimated wake-up delay is adapted until this fraction is reached."""

STEP_S: Final = 2e-6
"""Step by which one wake-up can change the estimated wake-up delay [s]."""

MAX_WAKE_UP_DELAY_S: Final = 100e-6
"""Largest wake-up delay that `MonotonicClock` compensates [s]."""


class Clock(Protocol):
    """Clock of a cell: that of the computer, or in lock-step that of a simulated cell."""

    @abstractmethod
    def now_s(self) -> float:
        """Return the time since an arbitrary start [s]; it never decreases."""

    @abstractmethod
    def sleep_until(self, time_s: float) -> None:
        """Wait until `time_s`, an absolute time on this clock [s]; never return earlier."""


class MonotonicClock:
    """The computer's monotonic clock, which changes of the system's date do not affect.

    A computer wakes a sleeping program with a delay that is nearly constant. `sleep_until`
    estimates this delay and sleeps for a time that is shorter by this delay. It waits actively for
    the rest, so that a cycle begins on time.

    Args:
        now_s, sleep: Function that returns CLOCK_MONOTONIC [s], and function that sleeps for a time
            [s].
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
        """Adapt the estimated wake-up delay: it tracks the quantile `EARLY` of the real delays."""
        step_s = (EARLY - early) * STEP_S
        self._waking_s = min(max(self._waking_s + step_s, 0.0), MAX_WAKE_UP_DELAY_S)
