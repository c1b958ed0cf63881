"""`NonlinearParameter`: a parameter in which the torque is not linear."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class NonlinearParameter:
    """A parameter in which the torque is not linear.

    Attributes:
        low, high: The allowed range.
    """

    name: str
    unit: str
    value: float
    low: float
    high: float
