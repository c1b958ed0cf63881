"""Friction columns from which the terms are chosen, as functions of speed and load."""

from __future__ import annotations

from typing import Final, Literal

import numpy as np

from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.friction_terms import FrictionTerm

Column = FrictionTerm | tuple[Literal["stribeck", "slope", "shear_thinning"], float]
"""Name of a friction column; ("slope", v) is the derivative of ("stribeck", v) by the speed v."""

SPEEDS_RAD_S: Final = (0.02, 0.03, 0.045, 0.07, 0.1, 0.15, 0.23, 0.35)
"""Candidate Stribeck speeds [rad/s or m/s]."""
THINNING_RAD_S: Final = (
    0.2, 0.25, 0.32, 0.4, 0.5, 0.63, 0.8, 1.0, 1.26, 1.6, 2.0, 2.5, 3.2, 4.0,
)  # fmt: skip
"""Candidate speeds of shear thinning [rad/s or m/s]; at higher ones friction is viscous."""
LINEAR: Final[tuple[Column, ...]] = (
    "coulomb", "viscous", "offset", "cubic", "load",
)  # fmt: skip
FLEXIBLE: Final[tuple[Column, ...]] = (
    *LINEAR,
    ("stribeck", 0.045), ("stribeck", 0.1), ("stribeck", 0.23),
)  # fmt: skip
"""Friction columns of every joint before its terms are known, to estimate the torque channel."""
ALL_COLUMNS: Final[tuple[Column, ...]] = (
    *LINEAR,
    *(("stribeck", speed) for speed in SPEEDS_RAD_S),
    *(("slope", speed) for speed in SPEEDS_RAD_S),
    *(("shear_thinning", speed) for speed in THINNING_RAD_S),
)


def friction_column(column: Column, v: FloatArray, load_nm: FloatArray) -> FloatArray:
    """Return a friction column of a joint, (rows,)."""
    direction = np.sign(v)
    match column:
        case "coulomb":
            return direction
        case "viscous":
            return v
        case "offset":
            return np.ones_like(v)
        case "cubic":
            return np.asarray(v**3)
        case "load":
            return direction * np.abs(load_nm)
        case ("stribeck", float(speed)):
            return np.asarray(direction * np.exp(-np.abs(v) / speed))
        case ("slope", float(speed)):
            share = np.abs(v) / speed
            return np.asarray(direction * share * np.exp(-share))
        case ("shear_thinning", float(speed)):
            return np.asarray(speed * np.arcsinh(v / speed))
        case _:
            raise EstimationError(f"unknown friction column {column}", code="RID-INTERNAL-ERROR")
