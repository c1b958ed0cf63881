"""`MotorTemperatures`: temperatures of the simulated motors, and their effects.

A motor is one thermal body: copper losses and a fraction of the friction heat warm it, and the
surroundings cool it. Warm grease reduces friction. Warm magnets give less torque per ampere. Drives
do not know this: a drive reports the current times the torque constant on the nameplate.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from config.robot.robot import RobotDescription
from config.simulation.plant import PlantConfig, SimulatedThermal

Vector = NDArray[np.float64]

LEAST_FRICTION = 0.2


class MotorTemperatures:
    """Temperatures of a robot's motors; that of a motor without `thermal` in the plant is constant.

    Attributes:
        temperature_k: Shape (n,). Temperatures of the motors, from base to flange [K].
        any: True if the temperature of at least one motor changes.
    """

    def __init__(self, robot: RobotDescription, plant: PlantConfig) -> None:
        models: list[SimulatedThermal | None] = [None] * len(robot.joints)
        if plant.unmodelled is not None:
            models = [extra.thermal for extra in plant.unmodelled.axes]
        self.any = any(model is not None for model in models)
        still = SimulatedThermal(time_constant_s=1.0, rise_k_per_w=1e-9, loss_at_rated_w=0.0)
        used = [still if model is None else model for model in models]
        self.temperature_k: Vector = np.array([model.initial_k for model in used])
        self._ambient_k = np.array([model.ambient_k for model in used])
        self._time_constant_s = np.array([model.time_constant_s for model in used])
        self._rise_k_per_w = np.array([model.rise_k_per_w for model in used])
        self._friction_fraction = np.array([model.friction_share for model in used])
        self._friction_per_k = np.array([model.friction_per_k for model in used])
        self._constant_per_k = np.array([model.torque_constant_per_k for model in used])
        self._reference_k = np.array([joint.reference_temperature_k for joint in robot.joints])
        rated_nm = np.array(
            [
                axis.rated_motor_torque_nm * abs(joint.gear_ratio)
                for axis, joint in zip(plant.axes, robot.joints, strict=True)
            ]
        )
        loss_w = np.array([model.loss_at_rated_w for model in used])
        self._loss_w_per_nm2 = loss_w / rated_nm**2
        self._coulomb_nm = np.array([axis.coulomb_nm for axis in plant.axes])
        self._viscous_nm_s = np.array([axis.viscous_nm_s for axis in plant.axes])

    @property
    def friction_factor(self) -> Vector:
        """Present friction divided by the friction at the reference temperature, (n,)."""
        return self._factor(self._friction_per_k, LEAST_FRICTION)

    @property
    def torque_constant_factor(self) -> Vector:
        """Present torque constant divided by that at the reference temperature, (n,)."""
        return self._factor(self._constant_per_k, LEAST_FRICTION)

    def advance(self, duration_s: float, torque: Vector, velocity: Vector) -> None:
        """Update the temperatures after a short interval.

        Args:
            duration_s: Duration [s].
            torque: Shape (n,). Motor torques, link side [N m].
            velocity: Shape (n,). Motor velocities, link side [rad/s].
        """
        speed = np.abs(velocity)
        friction_w = self.friction_factor * (self._coulomb_nm + self._viscous_nm_s * speed) * speed
        heat_w = self._loss_w_per_nm2 * torque * torque + self._friction_fraction * friction_w
        settled_k = self._ambient_k + self._rise_k_per_w * heat_w
        change = -np.expm1(-duration_s / self._time_constant_s)
        self.temperature_k += change * (settled_k - self.temperature_k)

    def _factor(self, per_k: Vector, least: float) -> Vector:
        factor = 1.0 + per_k * (self.temperature_k - self._reference_k)
        return np.asarray(np.maximum(least, factor))
