"""`Gravity`: the torque that each gear transmits at rest, and the joints' deflection by it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.errors import ConfigError
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain, link_transforms, point_jacobian
from dynamics.model.cad import cad_parameters
from dynamics.model.robot_model import RobotModel, load_torque
from identification.estimation.estimate import Estimate

_ITERATIONS: Final = 30
_CONVERGED: Final = 1e-13


@dataclass(frozen=True, eq=False)
class Gravity:
    """Torques at rest of a robot with a known load at its flange.

    The change of these torques by the calibrated geometry is neglected: it is about a thousandth.

    Attributes:
        chain: The nominal geometry.
        own: Function from joint positions (samples, n) to the torques of the robot alone, at the
            gears' outputs (samples, n) [N m or N].
        coupling: Shape (n, n). C of q = C alpha (5.18); the identity without a coupled wrist.
        load_centre_m: Shape (3,). Centre of gravity of the loads in the frame of the last link [m].
    """

    chain: Chain
    own: Callable[[FloatArray], FloatArray]
    coupling: FloatArray
    load_centre_m: FloatArray

    @classmethod
    def of_estimate(cls, estimate: Estimate, load_centre_m: FloatArray) -> Gravity:
        """Return the gravity of an identified model."""
        model, values = estimate.model, estimate.standard_values
        return cls._of_model(estimate.robot, model, values, load_centre_m)

    @classmethod
    def of_cad(cls, robot: RobotDescription, load_centre_m: FloatArray) -> Gravity:
        """Return the gravity of a robot's drawing data.

        Raises:
            ConfigError: The robot has no `cad`, its `cad` contains guesses, or it has a spring,
                whose torque is not in `cad`.
        """
        if robot.cad is not None and not robot.is_drawn:
            raise ConfigError(
                f"robot {robot.name!r} has guesses under `cad` (uncertainty: null): give a model"
                " that `identify` wrote",
                code="RID-ROBOT-CAD",
            )
        if robot.spring is not None:
            raise ConfigError(
                f"robot {robot.name!r} has a spring across {robot.spring.joint}, whose torque is"
                " not in `cad`: give a model that `identify` wrote",
                code="RID-ROBOT-CAD",
            )
        model = RobotModel.from_description(robot)
        return cls._of_model(robot, model, cad_parameters(model, robot)[0], load_centre_m)

    @classmethod
    def _of_model(
        cls,
        robot: RobotDescription,
        model: RobotModel,
        parameters: FloatArray,
        load_centre_m: FloatArray,
    ) -> Gravity:
        def own(position: FloatArray) -> FloatArray:
            still = np.zeros_like(position)
            return load_torque(model, position, still, still, parameters)

        n = len(robot.joints)
        coupling = np.eye(n) if robot.coupling is None else np.array(robot.coupling)
        return cls(Chain.from_description(robot), own, coupling, load_centre_m)

    def torque(self, position: FloatArray, load_kg: FloatArray) -> FloatArray:
        """Return the torque that each gear transmits at rest, (samples, n) [N m or N].

        Args:
            position: Shape (samples, n). Positions of the links [rad or m].
            load_kg: Shape (samples,). Mass at the flange.
        """
        links = link_transforms(self.chain, position)
        centre = links[:, -1, :3, :3] @ self.load_centre_m + links[:, -1, :3, 3]
        last = np.full(len(position), self.chain.n)
        weight = load_kg[:, np.newaxis] * self.chain.gravity_m_s2
        slopes = point_jacobian(self.chain, links, last, centre)
        of_load = -np.einsum("sij,si->sj", slopes, weight)
        return np.asarray(self.own(position) + of_load @ self.coupling)

    def link_positions(
        self, position: FloatArray, load_kg: FloatArray, compliance: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the positions of the links behind gears that bend under gravity.

        They solve q = theta - C (c tau(q)), theta from the motors' encoders.

        Args:
            position: Shape (samples, n). Joint positions from the encoders [rad or m].
            load_kg: Shape (samples,). Mass at the flange.
            compliance: Shape (n,). Compliance c of each gear [rad/(N m) or m/N].

        Returns:
            Positions of the links [rad or m] and torques of the gears [N m or N], each (samples,
            n).
        """
        links = position
        for _ in range(_ITERATIONS):
            torque = self.torque(links, load_kg)
            bent = position - (torque * compliance) @ self.coupling.T
            if np.abs(bent - links).max() < _CONVERGED:
                break
            links = bent
        return links, torque
