"""`DriveClock`: how long what a drive times by its own clock really takes."""

from __future__ import annotations


class DriveClock:
    """A drive's oscillator, which may run wrong; a timer takes the rate that it is started with.

    Attributes
    ----------
    rate
        How many seconds it counts in one.
    """

    def __init__(self) -> None:
        self.rate = 1.0

    def lasts(self, duration_s: float) -> float:
        """Return how long a duration of the drive's really is [s]."""
        return duration_s / self.rate
