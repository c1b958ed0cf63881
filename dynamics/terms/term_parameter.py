"""`NonlinearParameter`: a parameter on which the torque depends nonlinearly."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class NonlinearParameter:
    """A parameter on which the torque depends nonlinearly, with its present value.

    Attributes:
        low, high: Lowest and highest allowed value.
    """

    name: str
    unit: str
    value: float
    low: float
    high: float
