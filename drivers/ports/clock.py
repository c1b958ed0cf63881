"""`Clock`: the time that a link's deadlines are in, the computer's or a simulated bus's."""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Callable
from typing import Final, Protocol

EARLY: Final = 0.1
"""The share of wake-ups that `MonotonicClock` lets come early, to be waited out."""

STEP_S: Final = 2e-6
"""How far one wake-up moves what it has learnt, at most [s]."""

MOST_WAKING_S: Final = 100e-6
"""How much less `MonotonicClock` asks for, at most [s]."""


class Clock(Protocol):
    """Time as the cell has it: the computer's, or a simulated cell's in lock-step."""

    @abstractmethod
    def now_s(self) -> float:
        """Return the time since an arbitrary start [s]; never runs backwards."""

    @abstractmethod
    def sleep_until(self, time_s: float) -> None:
        """Return not before `time_s`, an absolute time of this clock [s]."""


class MonotonicClock:
    """The computer's monotonic clock, untouched by changes of the date.

    A computer takes some time to wake a program up, much the same each time. `sleep_until` learns
    how long, asks for so much less, and waits out what then is left: a cycle begins in time.

    Args:
        now_s, sleep: CLOCK_MONOTONIC [s], and how to sleep [s].
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
        """Sleep to an absolute deadline; returns at once when it has passed."""
        left_s = time_s - self._now_s()
        slept = left_s > self._waking_s
        while left_s > self._waking_s:
            self._sleep(left_s - self._waking_s)
            left_s = time_s - self._now_s()
        if slept:
            self._learn(early=left_s > 0.0)
        while left_s > 0.0:
            left_s = time_s - self._now_s()

    def _learn(self, *, early: bool) -> None:
        """Follow the time that waking up takes at least, but for the share `EARLY`."""
        step_s = (EARLY - early) * STEP_S
        self._waking_s = min(max(self._waking_s + step_s, 0.0), MOST_WAKING_S)
