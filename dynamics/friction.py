"""`Friction`: the term of every joint's friction, linear in its coefficients."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from config.errors import EstimationError
from config.robot import FrictionTerm, RobotDescription
from dynamics.kinematics import FloatArray

_SYMBOLS: Final[dict[FrictionTerm, str]] = {
    "coulomb": "fc",
    "viscous": "fv",
    "offset": "fo",
    "cubic": "f3",
    "cube_root": "fcr",
}
_REVOLUTE_UNITS: Final[dict[FrictionTerm, str]] = {
    "coulomb": "N m",
    "viscous": "N m s/rad",
    "offset": "N m",
    "cubic": "N m (s/rad)^3",
    "cube_root": "N m (s/rad)^(1/3)",
}
_PRISMATIC_UNITS: Final[dict[FrictionTerm, str]] = {
    "coulomb": "N",
    "viscous": "N s/m",
    "offset": "N",
    "cubic": "N (s/m)^3",
    "cube_root": "N (s/m)^(1/3)",
}


@dataclass(frozen=True)
class FrictionColumn:
    """One friction coefficient: which term, of which joint (from 0), its name and unit."""

    joint: int
    term: FrictionTerm
    parameter_name: str
    unit: str


@dataclass(frozen=True)
class Friction:
    """Friction of the joints, link side, in the terms that each joint chose (2.8-2.14).

    With `sign_smoothing_rad_s` > 0, sign(v) of the Coulomb term is tanh(v / sign_smoothing_rad_s).
    """

    columns: tuple[FrictionColumn, ...]
    sign_smoothing_rad_s: float = 0.0

    name = "friction"

    def __post_init__(self) -> None:
        if not 0.0 <= self.sign_smoothing_rad_s < np.inf:
            raise EstimationError(
                f"sign_smoothing_rad_s is {self.sign_smoothing_rad_s}: it must be 0 (a hard sign)"
                " or a small positive speed"
            )

    @classmethod
    def from_description(
        cls, robot: RobotDescription, *, sign_smoothing_rad_s: float = 0.0
    ) -> Friction:
        """Take the friction terms of the robot's joints, joint by joint."""
        columns = tuple(
            FrictionColumn(
                joint=j,
                term=term,
                parameter_name=f"{_SYMBOLS[term]}_{joint.name}",
                unit=(_PRISMATIC_UNITS if joint.type == "prismatic" else _REVOLUTE_UNITS)[term],
            )
            for j, joint in enumerate(robot.joints)
            for term in joint.friction
        )
        return cls(columns, sign_smoothing_rad_s)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """One name a coefficient."""
        return tuple(column.parameter_name for column in self.columns)

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """The units, in the order of the names."""
        return tuple(column.unit for column in self.columns)

    def fill_torque(self, motion: FloatArray, out: FloatArray) -> None:
        """Fill `out`, (samples, n, coefficients), for `motion`, (3, samples, n): q, v, a."""
        for c, column in enumerate(self.columns):
            out[:, column.joint, c] = self._shape(column.term, motion[1, :, column.joint])

    def fill_base_wrench(self, motion: FloatArray, out: FloatArray) -> None:
        """Leave `out` zero: friction acts between two links, and the base feels none of it."""

    def _shape(self, term: FrictionTerm, v: FloatArray) -> FloatArray:
        match term:
            case "coulomb":
                smoothing = self.sign_smoothing_rad_s
                return np.tanh(v / smoothing) if smoothing else np.sign(v)
            case "viscous":
                return v
            case "offset":
                return np.ones_like(v)
            case "cubic":
                return v**3
            case "cube_root":
                return np.cbrt(v)
