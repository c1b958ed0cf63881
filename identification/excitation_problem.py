"""`ExcitationProblem`: how good a periodic motion is and by how much it breaks limits.

The motion of joint j is q0 + sum_k a_k sin(k w t) + b_k cos(k w t) (2.30). All that is asked of it
is a smooth function of these coefficients: the criterion through the exact gradient of the
regressor, the limits as squared violations. Sampled at a handful of points per highest harmonic
(physics: section 10); `optimal_design` verifies the result on a dense grid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from acquisition.arrays import FloatArray
from config.bodies import Workspace
from config.errors import ConfigError
from config.motion import FourierJoint, FourierMotion
from config.robot import RobotDescription
from dynamics.inverse_dynamics import regressor_gradient
from dynamics.robot_model import RobotModel, regressor
from identification.base_parameters import BaseParameters, base_parameters
from identification.clearances import Clearances

Criterion = Literal["d_optimal", "condition"]

POINTS_PER_HARMONIC = 8
LIMIT_POINTS_PER_HARMONIC = 24
SIGN_SMOOTHING_SHARE = 0.02
NORM_POWER = 6
INFORMATION_SHARE = 0.3
CLEARANCE_SCALE_M = 0.05
DECIMALS = 6
START_POSES = 500
START_AMPLITUDE = 0.15


@dataclass(frozen=True, eq=False)
class ExcitationProblem:
    """One design task.

    Attributes
    ----------
    robot : RobotDescription
        The robot with its limits and bodies.
    period_s : float
        The period [s].
    harmonics : int
        The highest harmonic of every joint, N.
    criterion : "d_optimal" or "condition"
        Minus the log determinant of the information per parameter, or the log of the condition
        number (2.25, 2.26), smoothed, plus a share of the former: the condition number alone does
        not mind how small a motion is.
    limit_fraction : float
        Share of the position, velocity, acceleration and torque limits that may be used.
    expected_noise_nm : (n,) array
        Standard deviation of a torque sample; the rows' weights.
    parameters : (parameters,) array, or None
        A-priori standard parameters for the torque limits; None leaves torque out.
    given : (b, b) array, or None
        Information about the base parameters that earlier runs hold already.
    workspace : Workspace
        Where the robot may be.
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

    def __post_init__(self) -> None:
        n, b = len(self.robot.joints), len(self.base)
        if self.harmonics < 1 or not 0.0 < self.limit_fraction <= 1.0 or self.period_s <= 0.0:
            raise ConfigError(
                f"excitation design: harmonics {self.harmonics} must be at least 1, limit_fraction"
                f" {self.limit_fraction:g} above 0 and at most 1, period_s {self.period_s:g}"
                " positive"
            )
        if np.shape(self.expected_noise_nm) != (n,) or np.min(self.expected_noise_nm) <= 0.0:
            raise ConfigError("excitation design: expected_noise_nm needs a positive value a joint")
        if self.given is not None and self.given.shape != (b, b):
            raise ConfigError(
                f"excitation design: the earlier information has the shape {self.given.shape}, the"
                f" model {b} base parameters: give models of the same robot and terms"
            )

    @cached_property
    def model(self) -> RobotModel:
        """The model with a smoothed sign of the speed, which has a gradient."""
        fastest = max(joint.limits.velocity for joint in self.robot.joints)
        return RobotModel.from_description(
            self.robot, sign_smoothing_rad_s=SIGN_SMOOTHING_SHARE * fastest
        )

    @cached_property
    def base(self) -> BaseParameters:
        """What of the model can be identified at all."""
        return base_parameters(RobotModel.from_description(self.robot))

    @cached_property
    def clearances(self) -> Clearances:
        """The pairs of bodies that must stay apart."""
        return Clearances.of(self.robot, self.workspace)

    @property
    def size(self) -> int:
        """The number of variables: offset, sines and cosines of every joint."""
        return len(self.robot.joints) * (2 * self.harmonics + 1)

    @cached_property
    def _scales(self) -> FloatArray:
        """What a variable of one stands for, (n, 2 N + 1): half range, largest amplitudes."""
        omega = 2.0 * math.pi / self.period_s * np.arange(1, self.harmonics + 1)
        rows = []
        for joint in self.robot.joints:
            limits = joint.limits
            half = (limits.position_max - limits.position_min) / 2.0
            largest = np.minimum(
                half, np.minimum(limits.velocity / omega, limits.acceleration / omega**2)
            )
            rows.append(np.concatenate([[half], largest, largest]))
        return self.limit_fraction * np.array(rows)

    @cached_property
    def _middle(self) -> FloatArray:
        limits = [joint.limits for joint in self.robot.joints]
        return np.array([(each.position_max + each.position_min) / 2.0 for each in limits])

    def _basis(self, points: int) -> FloatArray:
        """Return offset, sines and cosines and their derivatives, (3, points, 2 N + 1)."""
        omega = 2.0 * math.pi / self.period_s * np.arange(1, self.harmonics + 1)
        angle = np.outer(np.arange(points) / points * self.period_s, omega)
        one, sine, cosine = np.ones((points, 1)), np.sin(angle), np.cos(angle)
        return np.array(
            [
                np.hstack([one, sine, cosine]),
                np.hstack([0.0 * one, omega * cosine, -omega * sine]),
                np.hstack([0.0 * one, -(omega**2) * sine, -(omega**2) * cosine]),
            ]
        )

    @cached_property
    def _coarse(self) -> FloatArray:
        return self._basis(POINTS_PER_HARMONIC * self.harmonics)

    @cached_property
    def _fine(self) -> FloatArray:
        return self._basis(LIMIT_POINTS_PER_HARMONIC * self.harmonics)

    def motion(self, x: FloatArray, basis: FloatArray) -> FloatArray:
        """Return q, v, a, (3, points, n), of variables of shape (size,)."""
        moved = basis @ self._coefficients(x).T
        moved[0] += self._middle
        return np.asarray(moved)

    def _coefficients(self, x: FloatArray) -> FloatArray:
        return np.asarray(x.reshape(self._scales.shape) * self._scales)

    def shrunk(self, x: FloatArray, share: float) -> FloatArray:
        """Return variables of the same motion with its amplitudes made smaller."""
        smaller = x.reshape(self._scales.shape).copy()
        smaller[:, 1:] *= share
        return smaller.ravel()

    def to_fourier(self, x: FloatArray, periods: int, transient_periods: int) -> FourierMotion:
        """Return variables as a motion file has them."""
        coefficients = np.round(self._coefficients(x), DECIMALS)
        n = self.harmonics
        return FourierMotion(
            kind="fourier",
            robot=self.robot.name,
            period_s=self.period_s,
            periods=periods,
            transient_periods=transient_periods,
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
        """Draw variables to start from: a pose that is clear of everything, moved about a little.

        Raises
        ------
        ConfigError
            No such pose is found: bodies or workspace cannot be meant.
        """
        random = np.random.default_rng(seed)
        x = START_AMPLITUDE * random.normal(size=self._scales.shape)
        decay = 1.0 / np.arange(1, self.harmonics + 1)
        x[:, 1:] *= np.concatenate([decay, decay])
        for _ in range(START_POSES):
            x[:, 0] = random.uniform(-0.8, 0.8, len(x))
            pose = self._middle + x[:, 0] * self._scales[:, 0]
            distances = self.clearances.distances(pose[np.newaxis])[0]
            if (distances >= self.clearances.margin_m).all():
                return np.asarray(x.ravel())
        nearest = int(np.argmin(distances))
        raise ConfigError(
            f"in none of {START_POSES} random poses is robot {self.robot.name!r} clear of itself"
            f" and of the workspace; in the last one {self.clearances.names[nearest]} are"
            f" {distances[nearest]:.3f} m apart: check `bodies` in the robot file and `workspace`"
            " in the cell file"
        )

    def value(self, x: FloatArray, penalty: float) -> tuple[float, FloatArray]:
        """Return criterion plus `penalty` times the squared violations, and the gradient."""
        q, v, a = self.motion(x, self._coarse)
        phi = regressor(self.model, q, v, a)
        weights = np.zeros_like(phi)
        kept = list(self.base.kept)
        rows = phi[:, :, kept] / self.expected_noise_nm[:, np.newaxis]
        worth, by_rows = self._criterion(rows)
        weights[:, :, kept] = by_rows / self.expected_noise_nm[:, np.newaxis]
        if self.parameters is not None:
            tau = phi @ self.parameters
            limit = self.limit_fraction * np.array([j.limits.torque for j in self.robot.joints])
            over, slope = _beyond(tau, -limit, limit, limit)
            worth += penalty * over
            weights += penalty * slope[:, :, np.newaxis] * self.parameters
        gradient = np.zeros(self._scales.shape)
        for basis, by in zip(
            self._coarse, regressor_gradient(self.model, q, v, a, weights), strict=True
        ):
            gradient += by.T @ basis

        fine = self.motion(x, self._fine)
        for kind, basis in enumerate(self._fine):
            low, high, size = self._bounds(kind)
            over, slope = _beyond(fine[kind], low, high, size)
            worth += penalty * over
            gradient += penalty * slope.T @ basis
        if len(self.clearances):
            short, by_q = self.clearances.shortfall(q)
            share = 1.0 / (len(q) * CLEARANCE_SCALE_M**2)
            worth += penalty * share * float(np.sum(short**2))
            gradient += penalty * 2.0 * share * by_q.T @ self._coarse[0]
        return worth, np.asarray((gradient * self._scales).ravel())

    def _bounds(self, kind: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return low, high and size of the limits of positions (0), velocities or accelerations."""
        limits = [joint.limits for joint in self.robot.joints]
        if kind == 0:
            half = np.array([(e.position_max - e.position_min) / 2.0 for e in limits])
            high = self.limit_fraction * half
            return self._middle - high, self._middle + high, half
        name = ("velocity", "acceleration")[kind - 1]
        high = self.limit_fraction * np.array([getattr(each, name) for each in limits])
        return -high, high, high

    def _criterion(self, rows: FloatArray) -> tuple[float, FloatArray]:
        """Return the criterion of weighted rows (points, n, b), and its gradient by them."""
        flat = rows.reshape(-1, rows.shape[2])
        information = flat.T @ flat / len(rows)
        if self.given is not None:
            information = information + self.given
        size = np.sqrt(np.diagonal(information))
        size = np.maximum(size, 1e-9 * size.max())
        scaled = information / np.outer(size, size)
        eigenvalues, vectors = np.linalg.eigh(scaled)
        eigenvalues = np.maximum(eigenvalues, 1e-14)
        b = len(size)
        worth = -float(np.sum(np.log(eigenvalues)) + 2.0 * np.sum(np.log(size))) / b
        by_information = -(vectors / eigenvalues) @ vectors.T / b / np.outer(size, size)
        if self.criterion == "condition":
            # The p-norms of the eigenvalues and of their inverses stand for the largest ones.
            high = (eigenvalues / eigenvalues[-1]) ** NORM_POWER
            low = (eigenvalues[0] / eigenvalues) ** NORM_POWER
            condition = 0.5 * (math.log(eigenvalues[-1]) - math.log(eigenvalues[0]))
            condition += 0.5 / NORM_POWER * (math.log(high.sum()) + math.log(low.sum()))
            slope = 0.5 * (high / high.sum() - low / low.sum()) / eigenvalues
            inner = (vectors * slope) @ vectors.T
            worth = condition + INFORMATION_SHARE * worth
            by_information = INFORMATION_SHARE * by_information + inner / np.outer(size, size)
            by_information -= np.diag(np.sum(inner * scaled, axis=1) / size**2)
        by_rows = 2.0 / len(rows) * rows @ by_information
        return worth, np.asarray(by_rows)


def _beyond(
    values: FloatArray, low: FloatArray, high: FloatArray, size: FloatArray
) -> tuple[float, FloatArray]:
    """Return the mean squared violation of limits, in shares of `size`, and its gradient."""
    over = (np.maximum(values - high, 0.0) + np.minimum(values - low, 0.0)) / size
    return float(np.sum(over**2)) / len(values), 2.0 * over / size / len(values)
