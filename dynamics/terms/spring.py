"""`Spring`: the term of a gravity-compensation spring across one joint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from config.arrays import FloatArray
from config.errors import ConfigError
from config.robot.robot import RobotDescription
from dynamics.terms.complex_step import Values, slopes
from dynamics.terms.motion import TermMotion

FOURIER_HARMONICS = 3


@dataclass(frozen=True)
class Spring:
    """A spring of stiffness k and free length l0 between two points (3.36-3.38).

    The points have the distances `l_m` and `r_m` from the joint's axis. The torque that holds the
    spring is k l r sin q - P0 l r sin q / L, where L = sqrt(l^2 + r^2 - 2 l r cos q) is the
    spring's length. It is linear in the parameters `k_spring` and `P0_spring` = k l0. If the
    distances are unknown or the robot file states `form: fourier`, the torque is a Fourier series
    of the joint angle up to the third harmonic (3.37): `A1_spring` cos q + `B1_spring` sin q + ...
    """

    joint: int
    distances_m: tuple[float, float] | None

    through_gears = True
    inertial = False
    name = "spring"

    @classmethod
    def from_description(cls, robot: RobotDescription) -> Spring:
        """Return the robot's spring.

        Raises:
            ConfigError: The robot has no spring, its joint is prismatic, or the spring would have
                no length at q = 0.
        """
        spring = robot.spring
        if spring is None:
            raise ConfigError(
                f"robot {robot.name!r} has no spring: add `spring` to the robot file",
                code="RID-ROBOT-VALUE",
            )
        joint = robot.joint_names.index(spring.joint)
        if robot.joints[joint].type == "prismatic":
            raise ConfigError(
                f"robot {robot.name!r}: spring.joint {spring.joint!r} is prismatic;"
                " a gravity spring acts across a revolute joint",
                code="RID-ROBOT-VALUE",
            )
        if spring.form == "fourier" or spring.l_m is None or spring.r_m is None:
            return cls(joint, None)
        if spring.l_m == spring.r_m:
            raise ConfigError(
                f"robot {robot.name!r}: spring.l_m and spring.r_m are both {spring.l_m} m, so its"
                " ends would coincide at joint angle 0; correct the two distances",
                code="RID-ROBOT-VALUE",
            )
        return cls(joint, (spring.l_m, spring.r_m))

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters: two, or six for the Fourier series."""
        if self.distances_m is not None:
            return ("k_spring", "P0_spring")
        return tuple(f"{s}{k}_spring" for k in range(1, FOURIER_HARMONICS + 1) for s in "AB")

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """Units of the parameters, in the order of `parameter_names`."""
        return ("N/m", "N") if self.distances_m is not None else ("N m",) * (2 * FOURIER_HARMONICS)

    def fill_torque(self, motion: TermMotion, out: FloatArray) -> None:
        """Compute the torque columns into `out`, (samples, n, 2 or 6)."""
        out[:, self.joint] = self._columns(motion.joint[0, :, self.joint])
        motion.to_actuators(out)

    def fill_base_wrench(self, motion: TermMotion, out: FloatArray) -> None:
        """Leave `out` zero: the spring acts between two links and not on the base."""

    def torque_gradient(self, motion: TermMotion, weights: FloatArray) -> FloatArray:
        """Return the gradient of weighted sums of torque columns by the motion; see `Term`."""
        out = np.zeros((len(weights), *motion.joint.shape))
        steepness = slopes(self._columns, motion.joint[0, :, self.joint])
        on_joint = motion.to_joints(weights)[:, :, self.joint]
        out[:, 0, :, self.joint] = np.sum(on_joint * steepness, axis=-1)
        return out

    def _columns(self, q: Values) -> Values:
        if self.distances_m is None:
            harmonics = range(1, FOURIER_HARMONICS + 1)
            return np.stack([f(k * q) for k in harmonics for f in (np.cos, np.sin)], axis=-1)
        l, r = self.distances_m  # noqa: E741 (symbols of the thesis)
        lever = l * r * np.sin(q)
        return np.stack([lever, -lever / np.sqrt(l**2 + r**2 - 2.0 * l * r * np.cos(q))], axis=-1)
