"""`TorqueScale`: agreement of an axis's torque constant with the force plate.

The plate measures forces independently of any motor. With one additional factor on each axis's
torques, the combined equations determine the error of every torque constant, with an interval.
Friction that does not depend on the load has no effect on the result: the plate does not measure
it, and each axis's friction parameters absorb the factor.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import chdtrc, fdtrc, stdtr

from config.arrays import FloatArray
from config.errors import EstimationError
from identification.equations.whitened import WhitenedEquations, bin_clusters
from identification.estimation.fitted_periods import FittedPeriods
from identification.estimation.nonlinear_parameters import step_prior
from identification.regression.intervals import jackknife
from identification.regression.least_squares import Triangle, solve
from identification.regression.multiple_tests import holm

STEPS: Final = 4
SIGNIFICANT_P: Final = 0.01
WORTH_TELLING: Final = 0.02


@dataclass(frozen=True)
class TorqueScale:
    """Torques of one axis compared with the force plate.

    Attributes:
        joint: The axis.
        ratio: Measured torque over the torque according to the plate.
        sigma: Standard deviation of the ratio, cluster-robust.
        p_value: Probability that any axis deviates from 1 this much if all torque constants are
            right (Holm).
    """

    joint: str
    ratio: float
    sigma: float
    p_value: float

    @property
    def wrong(self) -> bool:
        """True if the axis differs from the plate significantly, and by at least 2 %."""
        return self.p_value < SIGNIFICANT_P and abs(self.ratio - 1.0) >= WORTH_TELLING


@dataclass(frozen=True)
class TorqueConsistency:
    """Result of the consistency test of all axes.

    Attributes:
        axes: Result of each axis.
        p_value: Probability of deviations this large if all torque constants are right.
    """

    axes: tuple[TorqueScale, ...]
    p_value: float

    @property
    def sentence(self) -> str:
        """Text that names the axes that do not agree with the plate."""
        wrong = [axis for axis in self.axes if axis.wrong]
        if not wrong:
            ratios = ", ".join(f"{a.ratio:.4f} ± {2.0 * a.sigma:.4f}" for a in self.axes)
            small = "; load-dependent friction can cause such small deviations"
            return (
                "Torque constants and force plate agree: measured over expected torque is"
                f" {ratios} (p = {self.p_value:.2g}"
                f"{small if self.p_value < SIGNIFICANT_P else ''})."
            )
        words = "; ".join(
            f"{axis.joint} measures {abs(100.0 * (axis.ratio - 1.0)):.1f} ±"
            f" {200.0 * axis.sigma:.1f} % too {'much' if axis.ratio > 1.0 else 'little'}"
            f" (p = {axis.p_value:.1g})"
            for axis in wrong
        )
        if len(wrong) == len(self.axes) > 1 and self._alike():
            return (
                f"Compared with the force plate, all torques differ by the same factor: {words}."
                " The plate's sensitivity is probably wrong, rather than every torque constant."
            )
        return (
            f"Compared with the force plate, {words}: check the torque constant and the gear ratio"
            f" of {' and of '.join(axis.joint for axis in wrong)}."
        )

    def _alike(self) -> bool:
        weights = np.array([axis.sigma**-2 for axis in self.axes])
        ratios = np.array([axis.ratio for axis in self.axes])
        mean = float(np.sum(weights * ratios) / np.sum(weights))
        spread = float(np.sum(weights * (ratios - mean) ** 2))
        return bool(chdtrc(len(self.axes) - 1, spread) > SIGNIFICANT_P)


def torque_consistency(fitted: FittedPeriods) -> TorqueConsistency:
    """Test whether the torques of each axis agree with the force plate.

    Args:
        fitted: A fit of the combined model.

    Raises:
        EstimationError: The fit is of another model, or the motion does not determine the factors.
    """
    if fitted.options.kind != "combined":
        raise EstimationError(
            "torques and force plate can be compared only in a model that was identified from both:"
            " use --model combined",
            code="RID-MODEL-NOT-COMBINED",
        )
    joints = fitted.robot.joint_names
    n, width = len(joints), len(fitted.fit.solution.values)
    names = (*(f"value {k}" for k in range(width)), *(f"the torque scale of {j}" for j in joints))
    near, scale = fitted.fit.solution.values, np.ones(n)
    prior = fitted.problem.prior.triangle(width + n)
    known = [prior]
    if fitted.fit.nonlinear:
        known.append(step_prior(fitted.model, len(fitted.base), width + n))
    covariance, clusters = np.zeros((n, n)), 2
    for _ in range(STEPS):
        white = tuple(tuple(_with_scale_columns(parts, near, scale)) for parts in fitted.fit.white)
        triangles = [
            Triangle.empty(width + n).add(part.matrix, part.rhs, part.rows)
            for parts in white
            for part in parts
        ]
        solution = solve([*triangles, *known], [1.0] * (len(triangles) + len(known)), names)
        near, scale = solution.values[:width], scale + solution.values[width:]
        scatter = jackknife(solution.information, bin_clusters(white, solution.values))
        clustered, clusters = scatter.covariance, scatter.clusters
        covariance = np.where(
            np.outer(*[np.diagonal(clustered) >= np.diagonal(solution.covariance)] * 2),
            clustered,
            solution.covariance,
        )[width:, width:]
    sigma = np.sqrt(np.diagonal(covariance))
    freedom = max(clusters - 1, 1)
    alone = 2.0 * stdtr(freedom, -np.abs(scale - 1.0) / sigma)
    wald = float((scale - 1.0) @ np.linalg.solve(covariance, scale - 1.0)) / n
    return TorqueConsistency(
        tuple(
            TorqueScale(joint, float(ratio), float(s), float(p))
            for joint, ratio, s, p in zip(joints, scale, sigma, holm(alone), strict=True)
        ),
        float(fdtrc(n, freedom, wald)),
    )


def _with_scale_columns(
    parts: tuple[WhitenedEquations, ...], near: FloatArray, scale: FloatArray
) -> Iterator[WhitenedEquations]:
    """Yield the equations of each output with columns for the factors of the joints' torques.

    The first outputs are the joints' torques, the others those of the plate.
    """
    for j, part in enumerate(parts):
        columns = np.zeros((len(part.rhs), len(scale)))
        if j < len(scale):
            columns[:, j] = part.matrix @ near
            part = part.scale_model(float(scale[j]))
        yield part.add_columns(columns)
