"""`ExcitationProblem`: criterion of a periodic motion, and the amount by which it violates limits.

The motion of joint j is q0 + sum_k a_k sin(k w t) + b_k cos(k w t) (2.30). The criterion and the
limits are smooth functions of these coefficients: the criterion with the exact gradient of the
regressor, the limits as squared violations. The criterion is sampled at a few points per period of
the highest harmonic (theory: section 10), the limits at more points; `check_motion` verifies the
result.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from config.arrays import FloatArray
from config.errors import ConfigError
from config.robot.bodies import Workspace
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import WristCoupling
from dynamics.geometry.clearances import Clearances
from dynamics.model.base_wrench import base_wrench, base_wrench_gradient
from dynamics.model.inverse_dynamics import regressor_gradient
from dynamics.model.robot_model import RobotModel, regressor
from identification.design.criteria import Criterion
from identification.design.fourier_basis import fourier_basis
from identification.design.model import design_model
from identification.design.rest import CLEARANCE_SCALE_M, RestingPoses
from identification.model.base_parameters import BaseParameters, base_parameters

POINTS_PER_HARMONIC = 8
LIMIT_POINTS_PER_HARMONIC = 24
SIGN_SMOOTHING_SHARE = 0.02
DECIMALS = 6
START_RANGE = 0.8
START_AMPLITUDE = 0.15

Shifts = tuple[FloatArray, ...]


@dataclass(frozen=True, eq=False)
class ExcitationProblem:
    """A design task.

    Attributes:
        robot: The robot with its limits and bodies. Gears are assumed lossless, at the reference
            temperature.
        period_s: The period [s].
        harmonics: The highest harmonic of every joint, N.
        criterion: Criterion to minimise.
        limit_fraction: Usable fraction of the position, velocity, acceleration and torque limits.
        expected_noise_nm: Shape (n,). Standard deviation of a torque sample, for the rows' weights
            [N m or N].
        parameters: Shape (parameters,). A-priori standard parameters of `model` for the torque
            limits; with None, torque limits are not used.
        given: Shape (b, b). Information about the base parameters from earlier runs, per sample.
        workspace: Region in which the robot may be.
        base_limits: Shape (6,). Largest forces [N] and moments [N m] that the base may exert on the
            robot.
        torque_share: Fraction of the torque limits that the torques of `parameters` may use; the
            rest is reserved for torques that `parameters` do not contain.

    Raises:
        ConfigError: A value is out of its range, an array has the wrong shape, or base limits are
            given without `parameters`.
    """

    robot: RobotDescription
    period_s: float
    harmonics: int
    criterion: Criterion
    limit_fraction: float
    expected_noise_nm: FloatArray
    parameters: FloatArray | None = None
    given: FloatArray | None = None
    workspace: Workspace = field(default_factory=Workspace)
    base_limits: FloatArray | None = None
    torque_share: float = 1.0

    def __post_init__(self) -> None:
        n, b = len(self.robot.joints), len(self.base)
        if self.harmonics < 1 or not 0.0 < self.limit_fraction <= 1.0 or self.period_s <= 0.0:
            raise ConfigError(
                f"excitation design: harmonics is {self.harmonics} (at least 1 is needed),"
                f" limit_fraction is {self.limit_fraction:g} (more than 0, at most 1), period_s is"
                f" {self.period_s:g} (more than 0): correct the value outside of its range",
                code="RID-OPTION-RANGE",
            )
        if np.shape(self.expected_noise_nm) != (n,) or np.min(self.expected_noise_nm) <= 0.0:
            raise ConfigError(
                f"excitation design: expected_noise_nm needs {n} positive values, one for each"
                " joint",
                code="RID-OPTION-RANGE",
            )
        if self.given is not None and self.given.shape != (b, b):
            raise ConfigError(
                f"excitation design: the earlier information has the shape {self.given.shape},"
                f" but the model has {b} base parameters: use models of the same robot with the"
                " same terms",
                code="RID-ROBOT-OTHER",
            )
        if self.base_limits is not None and (
            self.parameters is None or self.base_limits.shape != (6,)
        ):
            raise ConfigError(
                "excitation design: base limits need six values and a-priori parameters: provide"
                " a model, or `cad` in the robot file",
                code="RID-ROBOT-CAD",
            )
        names = self.model.parameter_names
        if self.parameters is not None and self.parameters.shape != (len(names),):
            raise ConfigError(
                f"excitation design: the a-priori values have the shape {self.parameters.shape},"
                f" but robot {self.robot.name!r} has {len(names)} parameters",
                code="RID-API-ARGUMENT",
            )

    @cached_property
    def model(self) -> RobotModel:
        """The model, in which friction has the discontinuous sign of the speed."""
        return design_model(self.robot)

    @cached_property
    def _smooth_model(self) -> RobotModel:
        """The model with a smoothed sign of the speed, so that it has a gradient."""
        fastest = max(joint.limits.velocity for joint in self.robot.joints)
        return design_model(self.robot, SIGN_SMOOTHING_SHARE * fastest)

    @cached_property
    def base(self) -> BaseParameters:
        """The base parameters of the model."""
        return base_parameters(self.model)

    @cached_property
    def clearances(self) -> Clearances:
        """The pairs of bodies that must stay apart."""
        return Clearances.of(self.robot, self.workspace)

    def with_clearance(self, more_m: float) -> ExcitationProblem:
        """Return the same task with a larger clearance around the bodies."""
        clearance_m = self.workspace.clearance_m + more_m
        workspace = self.workspace.model_copy(update={"clearance_m": clearance_m})
        return replace(self, workspace=workspace)

    def information(self, rows: FloatArray) -> FloatArray:
        """Return the information per sample of weighted base rows (points, n, b), plus `given`."""
        flat = rows.reshape(-1, rows.shape[2])
        information = flat.T @ flat / len(rows)
        return information if self.given is None else information + self.given

    def weighted_rows(self, standard_regressor: FloatArray) -> FloatArray:
        """Return base rows divided by the expected noise, (points, n, b)."""
        return self.base.columns(standard_regressor) / self.expected_noise_nm[:, np.newaxis]

    @property
    def size(self) -> int:
        """Number of variables: offset, sine and cosine amplitudes of every joint."""
        return len(self.robot.joints) * (2 * self.harmonics + 1)

    @cached_property
    def _scales(self) -> FloatArray:
        """Scales of the variables, (n, 2 N + 1): half the range, then largest amplitudes."""
        omega = 2.0 * math.pi / self.period_s * np.arange(1, self.harmonics + 1)
        half, velocity, acceleration = self._sizes[:, :, np.newaxis]
        largest = np.minimum(half, np.minimum(velocity / omega, acceleration / omega**2))
        return np.asarray(self.limit_fraction * np.hstack([half, largest, largest]))

    @cached_property
    def _middle(self) -> FloatArray:
        limits = [joint.limits for joint in self.robot.joints]
        return np.array([(each.position_max + each.position_min) / 2.0 for each in limits])

    @cached_property
    def _coarse(self) -> FloatArray:
        return fourier_basis(self.period_s, self.harmonics, POINTS_PER_HARMONIC)

    @cached_property
    def _fine(self) -> FloatArray:
        return fourier_basis(self.period_s, self.harmonics, LIMIT_POINTS_PER_HARMONIC)

    def motion(self, x: FloatArray, basis: FloatArray) -> FloatArray:
        """Return q, v, a, (3, points, n), for variables of shape (size,)."""
        moved = basis @ self._coefficients(x).T
        moved[0] += self._middle
        return np.asarray(moved)

    def _coefficients(self, x: FloatArray) -> FloatArray:
        return np.asarray(x.reshape(self._scales.shape) * self._scales)

    def within_limits(self, x: FloatArray) -> FloatArray:
        """Return variables of the same motion, scaled down to the usable fraction of the limits.

        The limits are those of position, speed and acceleration. All amplitudes are multiplied by
        the same factor; the motion's middle pose does not change.
        """
        q, v, a = self.motion(x, self._fine)
        planned = self.limit_fraction * self._sizes
        centre = self._middle + self._coefficients(x)[:, 0]
        swing = q - centre
        room = [planned[0] - sign * (centre - self._middle) for sign in (1.0, -1.0)]
        used = [swing.max(axis=0), -swing.min(axis=0), np.abs(v).max(axis=0), np.abs(a).max(axis=0)]
        allowed = [*room, *planned[1:]]
        if self._to_motors is not None:
            used.append(np.abs(v @ self._to_motors.T).max(axis=0))
            allowed.append(planned[1])
        share = np.array(allowed) / np.maximum(used, 1e-12)
        return self.with_smaller_amplitudes(x, min(1.0, max(0.0, float(share.min()))))

    def with_smaller_amplitudes(self, x: FloatArray, share: float) -> FloatArray:
        """Return variables of the same motion with its amplitudes multiplied by `share`."""
        smaller = x.reshape(self._scales.shape).copy()
        smaller[:, 1:] *= share
        return smaller.ravel()

    def about_pose_of(self, x: FloatArray, pose_of: FloatArray) -> FloatArray:
        """Return variables of the same motion about the middle pose of another motion."""
        moved = x.reshape(self._scales.shape).copy()
        moved[:, 0] = pose_of.reshape(self._scales.shape)[:, 0]
        return moved.ravel()

    def to_fourier(self, x: FloatArray, periods: int) -> FourierMotion:
        """Return variables in the form of a motion file."""
        coefficients = np.round(self._coefficients(x), DECIMALS)
        n = self.harmonics
        return FourierMotion(
            kind="fourier",
            robot=self.robot.name,
            period_s=self.period_s,
            periods=periods,
            joints=tuple(
                FourierJoint(
                    joint=joint.name,
                    offset=round(float(row[0] + middle), DECIMALS),
                    sine=tuple(row[1 : n + 1].tolist()),
                    cosine=tuple(row[n + 1 :].tolist()),
                )
                for joint, row, middle in zip(
                    self.robot.joints, coefficients, self._middle, strict=True
                )
            ),
        )

    def start(self, seed: int) -> FloatArray:
        """Draw start variables: a small motion about a resting pose.

        Raises:
            ConfigError: No resting pose is found, from `RestingPoses.draw`.
        """
        random = np.random.default_rng(seed)
        x = START_AMPLITUDE * random.normal(size=self._scales.shape)
        decay = 1.0 / np.arange(1, self.harmonics + 1)
        x[:, 1:] *= np.concatenate([decay, decay])
        half, middle = self._scales[:, 0], self._middle
        resting = RestingPoses(
            self.model,
            self._prior,
            self.limit_fraction * self._torques,
            self.clearances,
            middle - START_RANGE * half,
            middle + START_RANGE * half,
        )
        x[:, 0] = (resting.draw(random, self.robot.name) - middle) / half
        return np.asarray(x.ravel())

    def value(self, x: FloatArray, penalty: float, shifts: Shifts) -> tuple[float, FloatArray]:
        """Return criterion plus penalties for violated limits, and the gradient.

        Args:
            x: Shape (size,). The variables.
            penalty: Factor of the mean squared violations, which are relative to the limits.
            shifts: Relative inward shift of each limit at each point, from `next_shifts`.
        """
        q, v, a = self.motion(x, self._coarse)
        phi = regressor(self._smooth_model, q, v, a)
        rows = self.weighted_rows(phi)
        objective, by_information = self.criterion.smooth(self.information(rows))
        weights = np.zeros_like(phi)
        by_rows = 2.0 / len(rows) * rows @ by_information
        weights[:, :, list(self.base.kept)] = by_rows / self.expected_noise_nm[:, np.newaxis]
        fine = self.motion(x, self._fine)
        coarse = np.array([q, v, a])
        over_q, over_v, over_a, over_torque, *over_more = self._excess(fine, coarse, phi, shifts)
        gradient = np.zeros(self._scales.shape)
        if self._to_motors is not None:
            over_motor = over_more.pop(0)
            share = penalty / len(fine[1])
            objective += share * float(np.sum(over_motor**2))
            slope = 2.0 * share * (over_motor[0] - over_motor[1]) / self._sizes[1]
            gradient += (slope @ self._to_motors).T @ self._fine[1]
        for basis, excess, size in zip(
            self._fine, (over_q, over_v, over_a), self._sizes, strict=True
        ):
            share = penalty / len(basis)
            objective += share * float(np.sum(excess**2))
            gradient += 2.0 * share * ((excess[0] - excess[1]) / size).T @ basis
        share = penalty / len(q)
        objective += share * float(np.sum(over_torque**2))
        slope = 2.0 * share * (over_torque[0] - over_torque[1]) / self._torques
        weights += slope[:, :, np.newaxis] * self._prior
        by_motion = np.array(regressor_gradient(self._smooth_model, q, v, a, weights))
        for excess in over_more:
            objective += share * float(np.sum(excess**2))
            slope = 2.0 * share * (excess[0] - excess[1]) / self.base_limits
            if slope.any():
                by_motion += base_wrench_gradient(self.model, q, v, a, self._prior, slope)
        for basis, by in zip(self._coarse, by_motion, strict=True):
            gradient += by.T @ basis
        if len(self.clearances):
            squares, by_q = self.clearances.shortfall(fine[0])
            share = penalty / (len(fine[0]) * CLEARANCE_SCALE_M**2)
            objective += share * squares
            gradient += share * by_q.T @ self._fine[0]
        return objective, np.asarray((gradient * self._scales).ravel())

    def no_shifts(self) -> Shifts:
        """Return the shifts for the first minimisation, all zero."""
        n, fine, coarse = len(self.robot.joints), len(self._fine[0]), len(self._coarse[0])
        rows = [(fine, n)] * 3 + [(coarse, n)]
        rows += [(fine, n)] * (self._to_motors is not None)
        rows += [(coarse, 6)] * (self.base_limits is not None)
        return tuple(np.zeros((2, *shape)) for shape in rows)

    def next_shifts(self, x: FloatArray, shifts: Shifts) -> Shifts:
        """Shift each limit inwards by its violation, or back if it is satisfied.

        The shifts are the multipliers of the augmented Lagrangian over the penalty (Hestenes 1969,
        Powell 1969; Rockafellar 1973 for inequalities).
        """
        coarse = self.motion(x, self._coarse)
        phi = regressor(self._smooth_model, *coarse)
        return tuple(self._excess(self.motion(x, self._fine), coarse, phi, shifts))

    def _excess(
        self, fine: FloatArray, coarse: FloatArray, phi: FloatArray, shifts: Shifts
    ) -> list[FloatArray]:
        """Return the relative violation of the shifted limits by q, v, a, torques and base wrench.

        Each array has the shape (2, points, n or 6): violation of the upper limit, then of the
        lower limit. A coupled wrist adds the array of the motors' speeds, which precedes that of
        the base wrench.
        """
        offsets = [fine[0] - self._middle, fine[1], fine[2], phi @ self._prior]
        sizes = [*self._sizes, self._torques]
        if self._to_motors is not None:
            offsets.append(fine[1] @ self._to_motors.T)
            sizes.append(self._sizes[1])
        if self.base_limits is not None:
            offsets.append(base_wrench(self.model, coarse[0], coarse[1], coarse[2], self._prior))
            sizes.append(self.base_limits)
        return [
            np.maximum(np.array([offset, -offset]) / size - self.limit_fraction + shift, 0.0)
            for offset, size, shift in zip(offsets, sizes, shifts, strict=True)
        ]

    @cached_property
    def _to_motors(self) -> FloatArray | None:
        """Matrix from the joints' speeds to the motors' speeds, on the link side, (n, n).

        It is None without a coupled wrist. A motor on the link side has the speed limit of its
        joint.
        """
        coupling = WristCoupling.of_robot(self.robot)
        return None if coupling is None else coupling.motors_by_joints

    @cached_property
    def _prior(self) -> FloatArray:
        """The a-priori parameters; zeros if none are given, so that all torques are zero."""
        if self.parameters is None:
            return np.zeros(len(self.model.parameter_names))
        return self.parameters

    @cached_property
    def _sizes(self) -> FloatArray:
        """Half the position range, largest speed, largest acceleration, (3, n)."""
        limits = [joint.limits for joint in self.robot.joints]
        return np.array(
            [
                [(each.position_max - each.position_min) / 2.0 for each in limits],
                [each.velocity for each in limits],
                [each.acceleration for each in limits],
            ]
        )

    @cached_property
    def _torques(self) -> FloatArray:
        return self.torque_share * np.array([joint.limits.torque for joint in self.robot.joints])
