"""`FrictionTerm`: the terms that a joint's friction may have, named without reading a robot."""

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
    "temperature",
    "load",
    "presliding",
]
