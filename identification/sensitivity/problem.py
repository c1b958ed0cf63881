"""Effect of wrong assumptions about a robot on a payload's estimate, as in chapter 5's table.

A robot with a payload is simulated with one difference from the assumptions, and the payload is
estimated as if all assumptions were right. There is no measurement and no noise, so that the error
of the estimate is due to this wrong assumption. `identification.sensitivity.monte_carlo` adds noise
and random errors of assumptions.
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
from dynamics.geometry.kinematics import flange_pose
from dynamics.model.robot_model import RobotModel, regressor, torque
from dynamics.terms.conditions import Conditions
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK
from identification.payload.body import PayloadBody, parameters_to_parent, reported

Comparison = Literal["model", "difference"]
"""Reference from which the payload's part of the torques is found: a model of the robot, or an
unloaded run."""

MOVING: Final = 1e-9
RANK: Final = 1e-8


@dataclass(frozen=True)
class Assumptions:
    """Differences between assumptions and reality; none by default.

    Attributes:
        gains: Length n, or empty. Assumed over true torque constant of each axis.
        links: Assumed over true inertial parameters of the robot's links.
        rotors: Assumed over true rotor inertias; 0 neglects them.
        coupling: Assumed over true coupling of the wrist; 0 neglects it.
        efficiency: True efficiency of every gear, which is assumed to be 1.
        joint_friction: Fraction of the friction that acts in the joints but is assumed to act in
            the motors.
        bias: Length n, or empty. Constant error of each axis's measured torque [N m].
        known_mass: Assumed over true mass; None estimates it.
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
    """A motion as samples: q, v, a of shape (samples, n)."""

    q: FloatArray
    v: FloatArray
    a: FloatArray

    def __post_init__(self) -> None:
        freeze(self, EstimationError, (None, None), "q", "v", "a")
        if not self.q.shape == self.v.shape == self.a.shape:
            raise EstimationError("q, v and a must have one shape", code="RID-API-ARGUMENT")

    @cached_property
    def moving(self) -> IntArray:
        """Indices of the axes that move."""
        return np.flatnonzero(np.abs(self.v).max(axis=0) > MOVING)


@dataclass(frozen=True, eq=False)
class SensitivityProblem:
    """A robot with known parameters, its payload and its motion.

    Attributes:
        parameters: Shape (p,). True standard parameters of `RobotModel.from_description(robot)`.
        payload: The true payload, in the flange's frame.
        motion: The motion of the robot.
        noise_nm: Shape (n,). Standard deviation of each axis's torque, for the axes' weights [N m
            or N].
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
        if self.motion.q.shape[1] != n:
            raise EstimationError(
                f"the motion has {self.motion.q.shape[1]} axes, but robot {self.robot.name!r} has"
                f" {n}: give a motion of this robot",
                code="RID-ROBOT-OTHER",
            )
        if not (noise > 0.0).all():
            raise EstimationError(
                f"the noise of an axis is {noise.min():g} N m or N, but must be positive",
                code="RID-OPTION-RANGE",
            )

    @cached_property
    def model(self) -> RobotModel:
        """The robot's model with a payload."""
        return RobotModel.from_description(self.robot, payload=True)

    @property
    def coupling(self) -> FloatArray:
        """The matrix C of q = C alpha; the unit matrix without a coupled wrist."""
        n = len(self.robot.joints)
        return np.eye(n) if self.robot.coupling is None else np.array(self.robot.coupling)

    def torque(self, assumed: Assumptions, loaded: bool) -> FloatArray:
        """Return the measured torques of the true robot, (samples, n) [N m or N]."""
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
        link = parameters_to_parent(flange_pose(self.robot)) @ self.payload.parameters
        values = np.concatenate([self.parameters, link])
        friction = model.parameter_groups.get("friction", slice(0, 0))
        in_joints = np.zeros_like(motion.q)
        if assumed.joint_friction:
            # Friction with the same coefficients that acts at the joints instead of the motors.
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
        """Return the conditions: drives at their reference temperature."""
        warm = np.array([joint.reference_temperature_k for joint in self.robot.joints])
        return Conditions(temperature_k=warm, payload=loaded)

    def assumed_model(self, assumed: Assumptions) -> RobotModel:
        """Return the robot's model with the assumed wrist coupling."""
        if assumed.coupling == 1.0 or self.robot.coupling is None:
            return self.model
        n = len(self.robot.joints)
        coupling = np.eye(n) + assumed.coupling * (self.coupling - np.eye(n))
        return replace(self.model, coupling=WristCoupling.of_matrix(coupling))


@dataclass(frozen=True, eq=False)
class MotionEstimator:
    """Least-squares estimator of payload and friction on one motion, for many torques.

    Attributes:
        matrix: Shape (samples n, 10 + any). Weighted columns of the payload, in the flange's frame,
            and of the identifiable friction.
        weights: Shape (n,). One over each axis's noise; 0 for an axis at rest (5.20).
        offset: Shape (samples, n). Torque of the assumed robot without payload [N m or N].
        mass: The fixed mass [kg]; None if the mass is estimated.
    """

    matrix: FloatArray
    weights: FloatArray
    offset: FloatArray
    mass: float | None

    @classmethod
    def of(
        cls, problem: SensitivityProblem, assumed: Assumptions, against: Comparison
    ) -> MotionEstimator:
        """Set up an estimator with the assumptions `assumed`.

        Raises:
            EstimationError: The motion does not determine all ten parameters of a payload.
        """
        model, motion = problem.assumed_model(assumed), problem.motion
        phi = regressor(model, motion.q, motion.v, motion.a, problem.conditions(True))
        groups, ten = model.parameter_groups, PARAMETERS_PER_LINK
        # An axis at rest is also held by an unknown friction torque, so it is not used.
        weights = np.zeros_like(problem.noise_nm)
        weights[motion.moving] = 1.0 / problem.noise_nm[motion.moving]
        payload = phi[:, :, groups["payload"]] @ parameters_to_parent(flange_pose(problem.robot))
        friction = phi[:, :, groups.get("friction", slice(0, 0))]
        columns = np.concatenate([payload, friction], axis=2) * weights[:, np.newaxis]
        matrix = columns.reshape(-1, columns.shape[2])
        is_identifiable = np.linalg.norm(matrix, axis=0) > MOVING * np.linalg.norm(matrix)
        is_identifiable[:ten] = True
        matrix = matrix[:, is_identifiable]
        held = 1 if assumed.known_mass is not None else 0
        scaled = matrix[:, held:] / np.linalg.norm(matrix[:, held:], axis=0)
        singular = np.linalg.svd(scaled, compute_uv=False)
        if not np.isfinite(singular).all() or singular[-1] < RANK * singular[0]:
            raise EstimationError(
                "this motion does not determine all ten parameters of a payload: use a motion that"
                " moves more axes",
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
        """The pseudo-inverse for the estimated parameters, shape (any, samples n)."""
        free = self.matrix if self.mass is None else self.matrix[:, 1:]
        size = np.linalg.norm(free, axis=0)
        return np.asarray(np.linalg.pinv(free / size) / size[:, np.newaxis])

    def values(self, tau: FloatArray) -> FloatArray:
        """Return the payload's ten parameters and the friction, from torques (samples, n)."""
        rhs = ((tau - self.offset) * self.weights).ravel()
        if self.mass is None:
            return np.asarray(self.inverse @ rhs)
        return np.array([self.mass, *(self.inverse @ (rhs - self.mass * self.matrix[:, 0]))])

    def parameters(self, tau: FloatArray) -> FloatArray:
        """Return the payload's ten parameters from torques (samples, n)."""
        return self.values(tau)[:PARAMETERS_PER_LINK]

    def residual(self, tau: FloatArray, values: FloatArray) -> FloatArray:
        """Return torques (samples, n) minus those of assumed robot, payload and friction.

        Args:
            values: Result of `values` for a motion of the same axes.

        Returns:
            Shape (samples, n); 0 for an axis at rest [N m or N].
        """
        moving = self.weights > 0.0
        weighted = (tau - self.offset) * self.weights - (self.matrix @ values).reshape(tau.shape)
        return np.asarray(np.where(moving, weighted / np.where(moving, self.weights, 1.0), 0.0))


def estimate_under_assumption(
    problem: SensitivityProblem, assumed: Assumptions, against: Comparison = "model"
) -> FloatArray:
    """Return the payload estimate that results from a wrong assumption, ten values of `REPORTED`.

    Raises:
        EstimationError: The motion does not determine all ten parameters.
    """
    tau = compared_torque(problem, assumed, against)
    return reported(MotionEstimator.of(problem, assumed, against).parameters(tau))


def compared_torque(
    problem: SensitivityProblem, assumed: Assumptions, against: Comparison
) -> FloatArray:
    """Return the torques (samples, n) from which the payload is estimated [N m or N].

    They are the torques of the loaded robot. If `against` is "difference", the torques of the
    unloaded robot are subtracted.
    """
    tau = problem.torque(assumed, True)
    return tau - problem.torque(assumed, False) if against == "difference" else tau


def prediction_error(
    problem: SensitivityProblem,
    assumed: Assumptions,
    against: Comparison,
    other: SampledMotion,
) -> tuple[FloatArray, FloatArray]:
    """Return error and torque of a payload estimate on another motion, as in figure 5.4.

    Assumed robot, estimated payload and estimated friction predict the loaded robot's torque. If
    `against` is "difference", the unloaded robot's torque on the other motion is known too.

    Args:
        other: Motion of the same axes that was not used for the estimate.

    Returns:
        Error of the prediction, and torque of the loaded robot, of shape (samples, n) each; the
        error of an axis at rest is 0 [N m or N].

    Raises:
        EstimationError: A motion does not determine all ten parameters, or the motions move
            different axes.
    """
    if not np.array_equal(other.moving, problem.motion.moving):
        raise EstimationError(
            "both motions must move the same axes, because friction is known only for these",
            code="RID-API-ARGUMENT",
        )
    used = MotionEstimator.of(problem, assumed, against)
    values = used.values(compared_torque(problem, assumed, against))
    judged = replace(problem, motion=other)
    error = MotionEstimator.of(judged, assumed, against).residual(
        compared_torque(judged, assumed, against), values
    )
    return error, judged.torque(assumed, True)


def root_mean_square(values: FloatArray) -> FloatArray:
    """Return the root mean square of each column."""
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


def deviation_percent(problem: SensitivityProblem, values: FloatArray) -> FloatArray:
    """Return the deviation of estimates (..., 10) as in table 5.3: in percent of the true value.

    For a negative true value, a positive deviation means a larger magnitude. NaN if the true value
    is zero.
    """
    truth = problem.payload.reported
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(truth != 0.0, 100.0 * (values - truth) / truth, np.nan))
