"""`Armature`: the term of motors' inertias if the mounting of the motors is unknown."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from dynamics.terms.motion import TermMotion


@dataclass(frozen=True)
class Armature:
    """Motor inertias at the link side, `Ia{i}` = mu^2 I_M; the torque is Ia times the acceleration.

    I_M is the rotor's inertia, mu the gear ratio. The effect of the rotor's spin on the link that
    carries it, and its wrench on the base, are neglected (theory: section 3); `Rotors` contains
    both effects.
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
        """Names of the parameters, one per armature."""
        return tuple(f"Ia{j + 1}" for j in self.joints)

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """Units of the parameters, in the order of `parameter_names`."""
        return self.units

    def fill_torque(self, motion: TermMotion, out: FloatArray) -> None:
        """Compute the torque columns into `out`, (samples, n, armatures)."""
        for column, j in enumerate(self.joints):
            out[:, j, column] = motion.actuator[2, :, j]

    def fill_base_wrench(self, motion: TermMotion, out: FloatArray) -> None:
        """Leave `out` zero, because the motors' mounting is unknown."""

    def torque_gradient(self, motion: TermMotion, weights: FloatArray) -> FloatArray:
        """Return the gradient of weighted sums of torque columns by the motion; see `Term`."""
        out = np.zeros((len(weights), *motion.actuator.shape))
        for column, j in enumerate(self.joints):
            out[:, 2, :, j] = weights[:, :, j, column]
        return motion.by_joints(out)
