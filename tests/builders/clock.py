"""A clock that the test sets."""

from __future__ import annotations


class Clock:
    """Clock with a settable time.

    Args:
        now_s: Initial time [s].
    """

    def __init__(self, now_s: float = 1000.0) -> None:
        self.now_s = now_s

    def __call__(self) -> float:
        return self.now_s
