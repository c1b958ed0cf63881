"""`NonlinearParameter`: a parameter that the torque is not linear in."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class NonlinearParameter:
    """One nonlinear parameter: its name, unit, value and the range that it must stay in."""

    name: str
    unit: str
    value: float
    low: float
    high: float
