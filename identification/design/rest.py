"""`RestingPoses`: search for poses in which the robot can rest, clear of obstacles."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.optimize import minimize

from config.arrays import FloatArray
from config.errors import ConfigError
from dynamics.geometry.clearances import Clearances
from dynamics.model.inverse_dynamics import regressor_gradient
from dynamics.model.robot_model import RobotModel, regressor

DRAWS: Final = 500
REFINED: Final = 8
CLEARANCE_SCALE_M: Final = 0.015
SLACK_M: Final = 0.002
MOST_SAID: Final = 4


@dataclass(frozen=True, eq=False)
class RestingPoses:
    """Requirements of a resting pose.

    Attributes:
        model: The robot's model.
        parameters: Shape (parameters,). A-priori values; with zeros, gravity has no effect.
        torque_limits: Shape (n,). Largest holding torques of the motors [N m or N].
        clearances: Bodies that must stay apart.
        low, high: Shape (n,). Range of the random poses [rad or m].
    """

    model: RobotModel
    parameters: FloatArray
    torque_limits: FloatArray
    clearances: Clearances
    low: FloatArray
    high: FloatArray

    def draw(self, random: np.random.Generator, robot: str) -> FloatArray:
        """Draw a pose (n,) in which the robot can rest.

        If none of `DRAWS` random poses is suitable, the poses closest to suitable ones are
        optimised.

        Raises:
            ConfigError: No pose is found; the message names `robot` and the violated requirements,
                with numbers.
        """
        drawn: list[FloatArray] = []
        for _ in range(DRAWS):
            pose = random.uniform(self.low, self.high)
            if self._can_rest(pose):
                return np.asarray(pose)
            drawn.append(pose)
        drawn.sort(key=lambda pose: self._excess(pose)[0])
        for pose in drawn[:REFINED]:
            bounds = list(zip(self.low, self.high, strict=True))
            led = minimize(self._excess, pose, jac=True, method="L-BFGS-B", bounds=bounds).x
            if self._can_rest(led):
                return np.asarray(led)
        raise ConfigError(
            f"robot {robot!r} can rest in none of {DRAWS} random poses:"
            f" {'; '.join(self._violated_requirements(np.array(drawn))[:MOST_SAID])}",
            code="RID-DESIGN-NONE",
        )

    def _torque(self, pose: FloatArray) -> FloatArray:
        rest = np.zeros((1, len(pose)))
        return np.asarray(regressor(self.model, pose[np.newaxis], rest, rest)[0] @ self.parameters)

    def _can_rest(self, pose: FloatArray) -> bool:
        if not self.clearances.is_clear(pose[np.newaxis]):
            return False
        return bool((np.abs(self._torque(pose)) <= self.torque_limits).all())

    def _excess(self, pose: FloatArray) -> tuple[float, FloatArray]:
        """Return a pose's squared violations of the requirements, and their gradient."""
        rest = np.zeros((1, len(pose)))
        share = self._torque(pose) / self.torque_limits
        over = np.sign(share) * np.maximum(np.abs(share) - 0.98, 0.0)
        weights = (2.0 * over / self.torque_limits)[:, np.newaxis] * self.parameters
        gradient = regressor_gradient(
            self.model, pose[np.newaxis], rest, rest, weights[np.newaxis]
        )[0][0]
        squares = float(over @ over)
        if len(self.clearances):
            farther = replace(self.clearances, margin_m=self.clearances.margin_m + SLACK_M)
            short, by_q = farther.shortfall(pose[np.newaxis])
            squares += short / CLEARANCE_SCALE_M**2
            gradient = gradient + by_q[0] / CLEARANCE_SCALE_M**2
        return squares, np.asarray(gradient)

    def _violated_requirements(self, poses: FloatArray) -> list[str]:
        """Return the requirements that no pose satisfies, or those that the best one violates."""
        names = self.model.joint_names
        held = np.abs([self._torque(pose) for pose in poses])
        gaps = np.array([self.clearances.nearest(pose[np.newaxis]) for pose in poses])
        never_held = held.min(axis=0) > self.torque_limits
        never_clear = gaps.max(axis=0) < self.clearances.margin_m
        if not never_held.any() and not never_clear.any():
            best = poses[0]
            never_held = np.abs(self._torque(best)) > self.torque_limits
            never_clear = self.clearances.nearest(best[np.newaxis]) < self.clearances.margin_m
            held, gaps = held[:1], gaps[:1]
        said = [
            f"{names[j]} needs a holding torque of {held[:, j].min():.3g}, but only"
            f" {self.torque_limits[j]:.3g} of its torque limit may be used: raise the limit, or"
            " correct `cad`"
            for j in np.flatnonzero(never_held)
        ]
        return said + [
            f"{self.clearances.names[pair]} are at most {gaps[:, pair].max():.3f} m apart, but"
            f" the required clearance is {self.clearances.margin_m:g} m: check `bodies` in the"
            " robot file and `workspace` in the cell file"
            for pair in np.flatnonzero(never_clear)
        ]
