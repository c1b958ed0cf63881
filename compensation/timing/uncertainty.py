"""Uncertainty of a robot's torques along a motion: margins for its limits."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from acquisition.motion.samples import JointTrajectory
from compensation.timing.timed_path import TorqueMargins
from config.arrays import FloatArray
from config.errors import ConfigError
from dynamics.terms.conditions import Conditions
from identification.estimation.estimate import Estimate
from identification.model.torque_columns import torque_columns, wrench_columns

BLOCK_ROWS = 2048


@dataclass(frozen=True, eq=False)
class ModelMargin:
    """Uncertainty of torques and base wrench of an estimate.

    The variance of a torque is the variance due to the estimated parameters, plus the part of the
    identification residual that noise does not explain (theory: section 13.7).

    Attributes:
        estimate: The model.
        confidence: Probability that a torque is within its margin, at any one instant.
        base: True to include the base wrench.
    """

    estimate: Estimate
    confidence: float
    base: bool = False

    def __post_init__(self) -> None:
        if not 0.0 < self.confidence < 1.0:
            raise ConfigError(
                f"invalid confidence {self.confidence:g}: give more than 0 and less than 1",
                code="RID-OPTION-RANGE",
            )

    @property
    def deviations(self) -> float:
        """Number of standard deviations that a margin has."""
        return NormalDist().inv_cdf(0.5 + 0.5 * self.confidence)

    def __call__(self, path: JointTrajectory) -> TorqueMargins:
        """Return the margins of rows of a motion."""
        rows, n = path.position.shape
        torque, base = np.zeros((rows, n)), np.zeros((rows, 6))
        for start in range(0, rows, BLOCK_ROWS):
            block = slice(start, start + BLOCK_ROWS)
            own = JointTrajectory(*(values[block] for values in path))
            torque[block] = self._torque_deviations(own)
            if self.base:
                base[block] = self._wrench_deviations(own)
        return TorqueMargins(self.deviations * torque, self.deviations * base)

    def _torque_deviations(self, path: JointTrajectory) -> FloatArray:
        """Return the standard deviations of the torques, shape (rows, n)."""
        estimate = self.estimate
        motion = (path.position, path.velocity, path.acceleration)
        columns = torque_columns(
            estimate.model, estimate.base, motion, Conditions(), estimate.standard_values
        )
        variance = self._variance(columns)
        variance += _unexplained_variance(estimate.residual_nm, estimate.noise_nm)
        return np.sqrt(variance)

    def _wrench_deviations(self, path: JointTrajectory) -> FloatArray:
        """Return the standard deviations of the base wrench, shape (rows, 6)."""
        estimate = self.estimate
        motion = (path.position, path.velocity, path.acceleration)
        columns = wrench_columns(
            estimate.model, estimate.base, motion, None, estimate.standard_values
        )
        variance = self._variance(columns)
        if estimate.plate is not None:
            variance += _unexplained_variance(estimate.plate.residual, estimate.plate.noise)
        return np.sqrt(variance)

    def _variance(self, columns: FloatArray) -> FloatArray:
        estimate = self.estimate
        b = len(estimate.base)
        found = _quadratic(columns[..., :b], estimate.covariance_jackknife)
        if estimate.covariance_noise is not None:
            found = np.maximum(found, _quadratic(columns[..., :b], estimate.covariance_noise))
        if columns.shape[-1] > b:
            found = found + _quadratic(columns[..., b:], estimate.nonlinear_covariance)
        return found


def _quadratic(columns: FloatArray, covariance: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("skb,skb->sk", columns @ covariance, columns))


def _unexplained_variance(residual: FloatArray, noise: FloatArray | None) -> FloatArray:
    """Return the variance of the residual that the noise does not explain."""
    own = 0.0 if noise is None else noise**2
    return np.asarray(np.maximum(residual**2 - own, 0.0))
