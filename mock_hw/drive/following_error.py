"""`FollowingError`: how far an axis is behind what it was told, and for how long (60F4h, 6065h)."""

from __future__ import annotations

import math

from mock_hw.drive.clock import DriveClock
from mock_hw.drive.object_dictionary import ObjectDictionary
from mock_hw.drive.objects import (
    FOLLOWING_ERROR_OFF,
    FOLLOWING_ERROR_TIME_MS,
    FOLLOWING_ERROR_WINDOW,
)


class FollowingError:
    """The integral of the velocity demand, compared with the encoder.

    A velocity loop with an integral part keeps that difference small - the difference is what its
    integrator holds -, so a stalled, slipping or runaway axis shows in it within moments.

    Attributes
    ----------
    counts
        Demand minus actual position, 60F4h.
    due_s
        When the difference will have been outside the window for too long [s]; infinity while it
        is inside.
    """

    def __init__(self, objects: ObjectDictionary, clock: DriveClock) -> None:
        self._objects = objects
        self._clock = clock
        self._demand = 0.0
        self._outside_s = math.inf
        self.counts = 0.0
        self.due_s = math.inf

    def start(self, position_counts: int) -> None:
        """Begin where the axis is: no error."""
        self._demand = float(position_counts)
        self.counts = 0.0
        self._outside_s = self.due_s = math.inf

    def follow(self, moved_counts: float, position_counts: int, now_s: float) -> None:
        """Take what the demand has moved by, and where the axis is at `now_s` [s]."""
        self._demand += moved_counts
        self.counts = self._demand - position_counts
        window = self._objects[FOLLOWING_ERROR_WINDOW]
        if window == FOLLOWING_ERROR_OFF or abs(self.counts) <= window:
            self._outside_s = self.due_s = math.inf
        elif self._outside_s == math.inf:
            self._outside_s = now_s
            self.due_s = now_s + self._clock.lasts(self._objects[FOLLOWING_ERROR_TIME_MS] * 1e-3)
