"""`NonlinearParameter`: one parameter that the torque is not linear in."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class NonlinearParameter:
    """One parameter that the torque is not linear in.

    Attributes:
        name, unit: What it is called, and its unit.
        low, high: The range that it must stay in.
    """

    name: str
    unit: str
    value: float
    low: float
    high: float
