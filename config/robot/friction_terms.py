"""`FrictionTerm`: names of the friction terms of a joint; importing it loads no robot model."""

from __future__ import annotations

from typing import Literal

FrictionTerm = Literal[
    "coulomb",
    "viscous",
    "offset",
    "asymmetric",
    "cubic",
    "cube_root",
    "stribeck",
    "shear_thinning",
    "temperature",
    "load",
    "presliding",
]
