"""`Warming`: temperature rise of joints due to their own friction, without measured temperatures.

Each joint is one body that its friction's power heats and the air cools. The thermal resistance is
unknown: the rise is computed with one kelvin per watt, and the coefficients of
temperature-dependent friction contain the true rise per watt. Every recording is assumed to start
cold.
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
        time_constant_s: Shape (n,). Time constant of each joint [s]; 0 if its friction shows no
            warming.
        time_constant_sigma_s: Shape (n,). Standard deviations [s]; 0 if the time constant is 0.
        coulomb_nm: Shape (n,). Coulomb friction that heats the joint [N m or N].
        viscous_nm_s: Shape (n,). Viscous friction that heats the joint [N m s/rad or N s/m].
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
        """Mask of the joints that warm up, (n,)."""
        return self.time_constant_s > 0.0

    def robot(self, robot: RobotDescription) -> RobotDescription:
        """Return a robot with the term `temperature` for exactly the joints that warm up."""
        own = []
        for joint, warms in zip(robot.joints, self.joints, strict=True):
            terms = tuple(term for term in joint.friction if term != "temperature")
            added = (*terms, "temperature") if warms else terms
            own.append(joint.model_copy(update={"friction": added}))
        return robot.model_copy(update={"joints": tuple(own)})

    def with_temperatures(
        self, robot: RobotDescription, signals: SmoothedSignals
    ) -> SmoothedSignals:
        """Return a recording with the temperatures that its motion causes.

        Args:
            robot: Robot whose reference temperatures are those of the cold joints.
            signals: The recording; measured temperatures in it are replaced.
        """
        return replace(signals, temperature_k=self._computed_temperatures(robot, signals, RISE))

    def with_temperature_slopes(
        self, robot: RobotDescription, signals: SmoothedSignals
    ) -> SmoothedSignals:
        """Return a recording whose temperature rises are derivatives by the time constants [K/s].

        Each rise above the joint's reference temperature is replaced by its derivative with respect
        to the joint's time constant. The reference temperature is still contained, because the
        friction term `temperature` subtracts it.
        """
        return replace(
            signals, temperature_k=self._computed_temperatures(robot, signals, BY_TIME_CONSTANT)
        )

    def steady_temperatures(self, robot: RobotDescription, velocity: FloatArray) -> FloatArray:
        """Return the steady-state temperatures of a motion repeated for long, (n,) [K].

        Args:
            robot: Robot whose reference temperatures are those of the cold joints.
            velocity: Shape (samples, n). Velocity of the whole motion, uniformly sampled [rad/s or
                m/s].
        """
        cold = np.array([joint.reference_temperature_k for joint in robot.joints])
        return np.asarray(cold + self.joints * self._power_w(robot, velocity).mean(axis=0))

    def _power_w(self, robot: RobotDescription, velocity: FloatArray) -> FloatArray:
        coupling = WristCoupling.of_robot(robot)
        speed = np.abs(velocity if coupling is None else coupling.to_motors(velocity))
        return np.asarray((self.coulomb_nm + self.viscous_nm_s * speed) * speed)

    def _computed_temperatures(
        self, robot: RobotDescription, signals: SmoothedSignals, what: int
    ) -> FloatArray:
        power_w = self._power_w(robot, signals.velocity)
        # The motion during a gap is unknown: the joint is assumed to be at rest and to cool.
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
