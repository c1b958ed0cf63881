"""Types of numbers in files: their sign, and the unit and plausible range of common quantities."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import BeforeValidator, Field

from config.plausible import Plausible


def _refuse_truth_value(value: object) -> object:
    """Return a value; Python counts true as 1, so a choice of numbers would accept it."""
    if isinstance(value, bool):
        raise ValueError(f"a number is expected, not {str(value).lower()}")
    return value


NoTruthValue = BeforeValidator(_refuse_truth_value)
Direction = Annotated[Literal[1, -1], NoTruthValue]

Vector3 = tuple[float, float, float]
Positive = Annotated[float, Field(gt=0.0)]
NonNegative = Annotated[float, Field(ge=0.0)]

Place = Annotated[Vector3, Plausible(0.0, 20.0, "m")]
Turn = Annotated[Vector3, Plausible(0.0, 11.0, "rad")]
Temperature = Annotated[Positive, Plausible(220.0, 450.0, "K")]
Mass = Annotated[Positive, Plausible(1e-4, 3e3, "kg")]
Inertia = Annotated[float, Plausible(0.0, 1e4, "kg m²")]
InertiaElements = tuple[Inertia, Inertia, Inertia, Inertia, Inertia, Inertia]

MOST_JOINTS: Final = 32
"""Largest number of joints of a robot, for which shared memory has space."""
