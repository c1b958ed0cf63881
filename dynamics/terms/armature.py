"""`Armature`: the term of motor inertias whose mounting is not known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from dynamics.terms.motion import Motion


@dataclass(frozen=True)
class Armature:
    """Plain motor inertias `Ia{i}` = mu^2 I_M at the link side: torque Ia times acceleration.

    Neither what the rotor's spin does to the link that carries it nor the wrench on the base is
    modelled (theory: section 3, "what a plain armature forgets"); `Rotors` does both.
    """

    joints: tuple[int, ...]
    units: tuple[str, ...]

    through_gears = False
    inertial = True
    name = "armature"

    @classmethod
    def from_description(cls, robot: RobotDescription) -> Armature:
        """Take every joint with a plain armature."""
        joints = tuple(j for j, joint in enumerate(robot.joints) if joint.armature)
        return cls(
            joints,
            tuple("kg" if robot.joints[j].type == "prismatic" else "kg m^2" for j in joints),
        )

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """One name an armature."""
        return tuple(f"Ia{j + 1}" for j in self.joints)

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """The units, in the order of the names."""
        return self.units

    def fill_torque(self, motion: Motion, out: FloatArray) -> None:
        """Fill `out`, (samples, n, armatures)."""
        for column, j in enumerate(self.joints):
            out[:, j, column] = motion.actuator[2, :, j]

    def fill_base_wrench(self, motion: Motion, out: FloatArray) -> None:
        """Leave `out` zero: nothing is known of where the motor sits."""

    def torque_gradient(self, motion: Motion, weights: FloatArray) -> FloatArray:
        """Return how sums of weights * columns change with the motion; see `Term`."""
        out = np.zeros((len(weights), *motion.actuator.shape))
        for column, j in enumerate(self.joints):
            out[:, 2, :, j] = weights[:, :, j, column]
        return motion.by_joints(out)
