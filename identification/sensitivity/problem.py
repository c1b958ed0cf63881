"""What wrong knowledge of a robot does to a payload's estimate: chapter 5's table, as numbers.

A robot with a payload is simulated with one thing different from what is assumed of it, and the
payload is estimated as if all assumptions were right. Nothing is measured here and no noise is in
it: what is left is the error that this wrong assumption makes.
`identification.sensitivity.monte_carlo` adds noise and beliefs that are wrong by chance.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final, Literal

import numpy as np

from config.arrays import FloatArray, IntArray, freeze, read_only
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import WristCoupling
from dynamics.model.robot_model import RobotModel, regressor, torque
from dynamics.terms.conditions import Conditions
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK
from identification.payload.body import PayloadBody, flange_pose, reported, to_link

Comparison = Literal["model", "difference"]
"""Less a model of the unloaded robot, or less a second run without the payload."""

MOVING: Final = 1e-9
RANK: Final = 1e-8


@dataclass(frozen=True)
class Assumptions:
    """How what is assumed differs from what is; by default nothing does.

    Attributes:
        gains: Length n, or empty. Assumed over true torque constant of each axis.
        links: Assumed over true inertial parameters of the robot's links.
        rotors: Assumed over true rotor inertias; 0 neglects them.
        coupling: Assumed over true coupling of the wrist; 0 neglects it.
        efficiency: True efficiency of every gear, assumed to be 1.
        joint_friction: Share of the friction that is in the joints and assumed to be in the motors.
        bias: Length n, or empty. Constant torque that each axis measures too much [N m].
        known_mass: Held mass over true mass; None estimates it.
    """

    gains: tuple[float, ...] = ()
    links: float = 1.0
    rotors: float = 1.0
    coupling: float = 1.0
    efficiency: float = 1.0
    joint_friction: float = 0.0
    bias: tuple[float, ...] = ()
    known_mass: float | None = None


@dataclass(frozen=True, eq=False)
class SampledMotion:
    """A motion, sampled: q, v, a of shape (samples, n)."""

    q: FloatArray
    v: FloatArray
    a: FloatArray

    def __post_init__(self) -> None:
        freeze(self, EstimationError, (None, None), "q", "v", "a")
        if not self.q.shape == self.v.shape == self.a.shape:
            raise EstimationError("q, v and a must have one shape", code="RID-API-ARGUMENT")

    @cached_property
    def moving(self) -> IntArray:
        """Which axes move at all."""
        return np.flatnonzero(np.abs(self.v).max(axis=0) > MOVING)


@dataclass(frozen=True, eq=False)
class SensitivityProblem:
    """A robot that is known exactly, what it carries, and how it moves.

    Attributes:
        parameters: Shape (p,). True standard parameters of `RobotModel.from_description(robot)`.
        payload: The true payload, in the flange's frame.
        motion: How it moves.
        noise_nm: Shape (n,). Standard deviation of each axis's torque; weights the axes [N m or N].
    """

    robot: RobotDescription
    parameters: FloatArray
    payload: PayloadBody
    motion: SampledMotion
    noise_nm: FloatArray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        n = len(self.robot.joints)
        model = RobotModel.from_description(self.robot)
        freeze(self, EstimationError, (len(model.parameter_names),), "parameters")
        noise = self.noise_nm if len(self.noise_nm) else np.ones(n)
        noise = read_only("noise_nm", noise, float, (n,), EstimationError)
        object.__setattr__(self, "noise_nm", noise)
        if self.motion.q.shape[1] != n or not (noise > 0.0).all():
            raise EstimationError(
                "the motion and the noise must be of this robot, noise positive",
                code="RID-ROBOT-OTHER",
            )

    @cached_property
    def model(self) -> RobotModel:
        """The robot's model with a payload."""
        return RobotModel.from_description(self.robot, payload=True)

    @property
    def coupling(self) -> FloatArray:
        """C of q = C alpha, the identity where there is none."""
        n = len(self.robot.joints)
        return np.eye(n) if self.robot.coupling is None else np.array(self.robot.coupling)

    def torque(self, assumed: Assumptions, loaded: bool) -> FloatArray:
        """Return what the drives would tell of the true robot, (samples, n) [N m or N]."""
        robot, motion = self.robot, self.motion
        if assumed.efficiency != 1.0:
            lossy = tuple(
                joint.model_copy(update={"efficiency": assumed.efficiency})
                for joint in robot.joints
            )
            robot = robot.model_copy(update={"joints": lossy})
        model = RobotModel.from_description(robot, payload=True)
        if assumed.efficiency != 1.0:
            model = model.with_nonlinear(np.full(len(model.nonlinear_names), assumed.efficiency))
        link = to_link(flange_pose(self.robot)) @ self.payload.parameters
        values = np.concatenate([self.parameters, link])
        friction = model.parameter_groups.get("friction", slice(0, 0))
        in_joints = np.zeros_like(motion.q)
        if assumed.joint_friction:
            # The same coefficients, but of the joints' speeds and on the joints' torques.
            uncoupled = replace(model, coupling=None)
            only = np.zeros_like(values)
            only[friction] = values[friction]
            still = np.zeros_like(motion.q)
            own = torque(uncoupled, motion.q, motion.v, still, only, self.conditions(False))
            in_joints = assumed.joint_friction * own @ self.coupling
            values[friction] *= 1.0 - assumed.joint_friction
        tau = torque(model, motion.q, motion.v, motion.a, values, self.conditions(loaded))
        tau = tau + in_joints
        if assumed.gains:
            tau = tau * np.array(assumed.gains)
        return tau + (np.array(assumed.bias) if assumed.bias else 0.0)

    def conditions(self, loaded: bool) -> Conditions:
        """Return the circumstances: drives at their reference temperature."""
        warm = np.array([joint.reference_temperature_k for joint in self.robot.joints])
        return Conditions(temperature_k=warm, payload=loaded)

    def assumed(self, assumed: Assumptions) -> RobotModel:
        """Return the model as it is assumed to be."""
        if assumed.coupling == 1.0 or self.robot.coupling is None:
            return self.model
        n = len(self.robot.joints)
        coupling = np.eye(n) + assumed.coupling * (self.coupling - np.eye(n))
        return replace(self.model, coupling=WristCoupling.of_matrix(coupling))


@dataclass(frozen=True, eq=False)
class MotionEstimator:
    """Least squares of payload and friction on one motion, ready for many right sides.

    Attributes:
        matrix: Shape (samples n, 10 + any). Weighted columns of the payload, in the flange's frame,
            and of the friction that is seen.
        weights: Shape (n,). One over each axis's noise; 0 for one that stands still (5.20).
        offset: Shape (samples, n). What the robot as assumed takes of the torque.
        mass: The held mass [kg].
    """

    matrix: FloatArray
    weights: FloatArray
    offset: FloatArray
    mass: float | None

    @classmethod
    def of(
        cls, problem: SensitivityProblem, assumed: Assumptions, against: Comparison
    ) -> MotionEstimator:
        """Set up an estimator that assumes what `assumed` says.

        Raises:
            EstimationError: The motion does not show all ten parameters of a payload.
        """
        model, motion = problem.assumed(assumed), problem.motion
        phi = regressor(model, motion.q, motion.v, motion.a, problem.conditions(True))
        groups, ten = model.parameter_groups, PARAMETERS_PER_LINK
        # An axis at rest is held by friction too, nobody knows by how much: it tells nothing.
        weights = np.zeros_like(problem.noise_nm)
        weights[motion.moving] = 1.0 / problem.noise_nm[motion.moving]
        payload = phi[:, :, groups["payload"]] @ to_link(flange_pose(problem.robot))
        friction = phi[:, :, groups.get("friction", slice(0, 0))]
        columns = np.concatenate([payload, friction], axis=2) * weights[:, np.newaxis]
        matrix = columns.reshape(-1, columns.shape[2])
        told = np.linalg.norm(matrix, axis=0) > MOVING * np.linalg.norm(matrix)
        told[:ten] = True
        matrix = matrix[:, told]
        held = 1 if assumed.known_mass is not None else 0
        scaled = matrix[:, held:] / np.linalg.norm(matrix[:, held:], axis=0)
        singular = np.linalg.svd(scaled, compute_uv=False)
        if not np.isfinite(singular).all() or singular[-1] < RANK * singular[0]:
            raise EstimationError(
                "this motion does not show all ten parameters of a payload: move more axes",
                code="RID-MOTION-UNINFORMATIVE",
            )
        offset = np.zeros_like(motion.q)
        if against == "model":
            values = np.zeros(len(model.parameter_names))
            values[: len(problem.parameters)] = problem.parameters
            values[groups["rigid_body"]] *= assumed.links
            for name in ("rotors", "armature"):
                if name in groups:
                    values[groups[name]] *= assumed.rotors
            values[groups.get("friction", slice(0, 0))] = 0.0
            offset = phi @ values
        mass = None
        if assumed.known_mass is not None:
            mass = assumed.known_mass * problem.payload.mass_kg
        return cls(matrix, weights, offset, mass)

    @cached_property
    def inverse(self) -> FloatArray:
        """The pseudo-inverse of what is estimated, shape (any, samples n)."""
        free = self.matrix if self.mass is None else self.matrix[:, 1:]
        size = np.linalg.norm(free, axis=0)
        return np.asarray(np.linalg.pinv(free / size) / size[:, np.newaxis])

    def parameters(self, tau: FloatArray) -> FloatArray:
        """Return the payload's ten parameters out of torques (samples, n)."""
        rhs = ((tau - self.offset) * self.weights).ravel()
        if self.mass is None:
            return np.asarray((self.inverse @ rhs)[:PARAMETERS_PER_LINK])
        rest = self.inverse @ (rhs - self.mass * self.matrix[:, 0])
        return np.array([self.mass, *rest[: PARAMETERS_PER_LINK - 1]])


def estimated(
    problem: SensitivityProblem, assumed: Assumptions, against: Comparison = "model"
) -> FloatArray:
    """Return the payload that a wrong assumption leads to, ten values of `REPORTED`.

    Raises:
        EstimationError: The motion does not show all ten parameters.
    """
    tau = problem.torque(assumed, True)
    if against == "difference":
        tau = tau - problem.torque(assumed, False)
    return reported(MotionEstimator.of(problem, assumed, against).parameters(tau))


def deviation_percent(problem: SensitivityProblem, values: FloatArray) -> FloatArray:
    """Return how far estimates (..., 10) are off, as in table 5.3: in percent of the true value.

    Percent of a negative value are positive where the estimate is larger in size. Not a number
    where the true value is zero.
    """
    truth = problem.payload.reported
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(truth != 0.0, 100.0 * (values - truth) / truth, np.nan))
