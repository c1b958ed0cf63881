"""`Warming`: how joints warm up by their own friction, where no one measured their temperature.

Each joint is one body that its friction's power heats and the air cools. What a watt warms it by is
not known: the rise is counted in kelvins as if it were one kelvin a watt, and the coefficients of
friction by temperature hold the rest. A recording begins cold.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from acquisition.processing.smoothing import GAP_STEPS, SmoothedSignals
from config.arrays import BoolArray, FloatArray, freeze
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import WristCoupling
from dynamics.kernels.thermal import BY_TIME_CONSTANT, RISE, warm_up


@dataclass(frozen=True, eq=False)
class Warming:
    """Time constants of the joints' temperatures, and the friction that heats them.

    Attributes:
        time_constant_s: Shape (n,). Of each joint [s]; 0 where its friction does not show that it
            warms up.
        time_constant_sigma_s: Shape (n,). Standard deviations; 0 there.
        coulomb_nm: Shape (n,). Coulomb friction whose power counts [N m or N].
        viscous_nm_s: Shape (n,). Viscous friction whose power counts [N m s/rad or N s/m].
    """

    time_constant_s: FloatArray
    time_constant_sigma_s: FloatArray
    coulomb_nm: FloatArray
    viscous_nm_s: FloatArray

    def __post_init__(self) -> None:
        freeze(self, EstimationError, (None,), "time_constant_s")
        shape = (len(self.time_constant_s),)
        freeze(self, EstimationError, shape, "time_constant_sigma_s", "coulomb_nm", "viscous_nm_s")

    @property
    def joints(self) -> BoolArray:
        """Which joints warm up, (n,)."""
        return self.time_constant_s > 0.0

    def robot(self, robot: RobotDescription) -> RobotDescription:
        """Return a robot whose friction depends on temperature where joints warm up, only there."""
        own = []
        for joint, warms in zip(robot.joints, self.joints, strict=True):
            terms = tuple(term for term in joint.friction if term != "temperature")
            added = (*terms, "temperature") if warms else terms
            own.append(joint.model_copy(update={"friction": added}))
        return robot.model_copy(update={"joints": tuple(own)})

    def warmed(self, robot: RobotDescription, signals: SmoothedSignals) -> SmoothedSignals:
        """Return a recording with the temperatures that its motion leads to.

        Args:
            robot: Whose reference temperatures are those of the cold joints.
            signals: What was recorded; a temperature that it has is replaced.
        """
        return replace(signals, temperature_k=self._followed(robot, signals, RISE))

    def by_time_constant(
        self, robot: RobotDescription, signals: SmoothedSignals
    ) -> SmoothedSignals:
        """Return the same with the derivative [K/s] by each time constant as the joint's rise."""
        return replace(signals, temperature_k=self._followed(robot, signals, BY_TIME_CONSTANT))

    def settled(self, robot: RobotDescription, velocity: FloatArray) -> FloatArray:
        """Return the temperatures that a motion leads to when it is repeated for long, (n,) [K].

        Args:
            robot: Whose reference temperatures are those of the cold joints.
            velocity: Shape (samples, n). Of the whole motion, uniformly sampled [rad/s or m/s].
        """
        cold = np.array([joint.reference_temperature_k for joint in robot.joints])
        return np.asarray(cold + self.joints * self._power_w(robot, velocity).mean(axis=0))

    def _power_w(self, robot: RobotDescription, velocity: FloatArray) -> FloatArray:
        coupling = WristCoupling.of_robot(robot)
        speed = np.abs(velocity if coupling is None else coupling.to_motors(velocity))
        return np.asarray((self.coulomb_nm + self.viscous_nm_s * speed) * speed)

    def _followed(self, robot: RobotDescription, signals: SmoothedSignals, what: int) -> FloatArray:
        power_w = self._power_w(robot, signals.velocity)
        # Over a gap nothing is known; a joint that stood cools.
        gap = np.diff(signals.time_s) > GAP_STEPS * signals.sample_period_s
        power_w[:-1][gap] = 0.0
        found = np.zeros((len(signals), len(robot.joints)))
        out = np.empty((len(signals), 2))
        for j in np.flatnonzero(self.joints):
            heat = np.ascontiguousarray(power_w[:, j])
            warm_up(signals.time_s, heat, float(self.time_constant_s[j]), out)
            found[:, j] = out[:, what]
        found += [joint.reference_temperature_k for joint in robot.joints]
        return found
