"""`FrictionTerm`: names and meanings of the friction terms; importing it loads no robot model."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, Literal

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

FRICTION_TERM_WORDS: Final[Mapping[FrictionTerm, str]] = MappingProxyType(
    {
        "coulomb": "constant, against the motion",
        "viscous": "proportional to the speed",
        "offset": "constant, the same in both directions",
        "asymmetric": "constant, different in each direction",
        "cubic": "grows with the cube of the speed",
        "cube_root": "grows with the cube root of the speed",
        "stribeck": "larger near standstill",
        "shear_thinning": "viscous, grows more slowly at high speed",
        "temperature": "changes with the temperature of the joint",
        "load": "grows with the transmitted torque",
        "presliding": "elastic before the joint slides",
    }
)
"""Meaning of each term."""
