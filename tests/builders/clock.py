"""A clock that a test moves on."""

from __future__ import annotations


class Clock:
    """Tells the time that it was set to.

    Args:
        now_s: What it tells at first [s].
    """

    def __init__(self, now_s: float = 1000.0) -> None:
        self.now_s = now_s

    def __call__(self) -> float:
        return self.now_s
