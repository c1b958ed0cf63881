"""`Spring`: the term of a gravity-compensation spring across one joint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from config.errors import ConfigError
from config.robot import RobotDescription
from dynamics.kinematics import FloatArray


@dataclass(frozen=True)
class Spring:
    """A spring of stiffness k and free length l0 between two points (3.36-3.38).

    The points lie `l_m` and `r_m` from the joint's axis. The actuator's torque against the spring,
    k l r sin q - P0 l r sin q / L with L = sqrt(l^2 + r^2 - 2 l r cos q), is linear in the
    parameters `k_spring` and `P0_spring` = k l0.
    """

    joint: int
    l_m: float
    r_m: float

    name = "spring"
    parameter_names = ("k_spring", "P0_spring")
    parameter_units = ("N/m", "N")

    @classmethod
    def from_description(cls, robot: RobotDescription) -> Spring:
        """Take the robot's spring.

        Raises
        ------
        ConfigError
            Where the robot has none, or its geometry has no length at q = 0, or its joint slides.
        """
        spring = robot.spring
        if spring is None:
            raise ConfigError(f"robot {robot.name!r} has no spring")
        joint = robot.joint_names.index(spring.joint)
        if robot.joints[joint].type == "prismatic":
            raise ConfigError(
                f"robot {robot.name!r}: spring.joint {spring.joint!r} is prismatic;"
                " a gravity spring acts across a revolute joint"
            )
        if spring.l_m == spring.r_m:
            raise ConfigError(
                f"robot {robot.name!r}: spring.l_m and spring.r_m are both {spring.l_m} m, so its"
                " ends would meet at zero angle; check the two distances"
            )
        return cls(joint, spring.l_m, spring.r_m)

    def fill_torque(self, motion: FloatArray, out: FloatArray) -> None:
        """Fill `out`, (samples, n, 2), for `motion`, (3, samples, n): q, v, a."""
        q = motion[0, :, self.joint]
        product = self.l_m * self.r_m
        length = np.sqrt(self.l_m**2 + self.r_m**2 - 2.0 * product * np.cos(q))
        lever = product * np.sin(q)
        out[:, self.joint, 0] = lever
        out[:, self.joint, 1] = -lever / length

    def fill_base_wrench(self, motion: FloatArray, out: FloatArray) -> None:
        """Leave `out` zero: the spring acts between two links."""
