"""`Armature`: the term of motor inertias with unknown mounting."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from dynamics.terms.motion import TermMotion


@dataclass(frozen=True)
class Armature:
    """Motor inertias `Ia{i}` = mu^2 I_M at the link side: torque Ia times acceleration.

    The effect of the rotor's spin on the link that carries it, and the wrench on the base, are not
    modelled (theory: section 3); `Rotors` models both.
    """

    joints: tuple[int, ...]
    units: tuple[str, ...]

    through_gears = False
    inertial = True
    name = "armature"

    @classmethod
    def from_description(cls, robot: RobotDescription) -> Armature:
        """Return the armatures of a robot's joints."""
        joints = tuple(j for j, joint in enumerate(robot.joints) if joint.armature)
        return cls(
            joints,
            tuple("kg" if robot.joints[j].type == "prismatic" else "kg m^2" for j in joints),
        )

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """One name per armature."""
        return tuple(f"Ia{j + 1}" for j in self.joints)

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """The units, in the order of the names."""
        return self.units

    def fill_torque(self, motion: TermMotion, out: FloatArray) -> None:
        """Fill `out`, (samples, n, armatures)."""
        for column, j in enumerate(self.joints):
            out[:, j, column] = motion.actuator[2, :, j]

    def fill_base_wrench(self, motion: TermMotion, out: FloatArray) -> None:
        """Leave `out` zero, because the mounting of the motor is not known."""

    def torque_gradient(self, motion: TermMotion, weights: FloatArray) -> FloatArray:
        """Return the gradient of sums of weights * columns by the motion; see `Term`."""
        out = np.zeros((len(weights), *motion.actuator.shape))
        for column, j in enumerate(self.joints):
            out[:, 2, :, j] = weights[:, :, j, column]
        return motion.by_joints(out)
