"""`fit_arm`: the maximum-likelihood fit of an arm to measured points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.tracker.pose_file import MeasuredPoses
from config.arrays import FloatArray
from config.errors import EstimationError
from identification.kinematics.arm import PlacedArm
from identification.kinematics.parameters import KinematicParameter

_ITERATIONS: Final = 40
_CONVERGED: Final = 1e-9
"""Change of the sum of squares, relative to itself, that ends the iteration."""
_HALVINGS: Final = 12


@dataclass(frozen=True, eq=False)
class ArmFit:
    """An arm fitted to measured points.

    Attributes:
        arm: The fitted arm.
        parameters: The p fitted parameters.
        covariance: Shape (p, p). Covariance of the parameters if every coordinate has the standard
            deviation that the poses state, or 1 m if they state none.
        residual_m: Shape (poses, 3). Measured minus fitted points.
        weighted: Shape (poses, 3). Residuals over the standard deviations.
    """

    arm: PlacedArm
    parameters: tuple[KinematicParameter, ...]
    covariance: FloatArray
    residual_m: FloatArray
    weighted: FloatArray

    @property
    def freedom(self) -> int:
        """Number of equations minus number of parameters."""
        return self.weighted.size - len(self.parameters)

    @property
    def scale(self) -> float:
        """RMS of the weighted residuals, with the degrees of freedom of the fit."""
        return float(np.sqrt(np.sum(self.weighted**2) / self.freedom))

    def point_sigma(self, position: FloatArray, load_kg: FloatArray) -> FloatArray:
        """Return the standard deviation of fitted coordinates, (samples, 3), if `scale` is 1."""
        slopes = self.arm.slopes(position, load_kg, self.parameters)
        return np.asarray(np.sqrt(np.einsum("sip,pq,siq->si", slopes, self.covariance, slopes)))


def fit_arm(
    start: PlacedArm, poses: MeasuredPoses, parameters: Sequence[KinematicParameter]
) -> ArmFit:
    """Fit some parameters of an arm to measured points by Gauss-Newton steps.

    Args:
        start: The arm with the initial values; other parameters keep their values.
        poses: The measured points.
        parameters: Parameters whose effects are independent, in these poses.

    Raises:
        EstimationError: The fit does not converge, or there are fewer equations than parameters.
    """
    sigma = np.ones(len(poses)) if poses.sigma_m is None else poses.sigma_m
    if 3 * len(poses) <= len(parameters):
        raise EstimationError(
            f"{poses.name}: {len(poses)} poses give {3 * len(poses)} coordinates for"
            f" {len(parameters)} parameters: measure more poses",
            code="RID-KINEMATICS-FEW",
        )
    arm = start
    residual = poses.point_m - arm.points(poses.position, poses.load_kg)
    cost = _cost(residual, sigma)
    for _ in range(_ITERATIONS):
        slopes = arm.slopes(poses.position, poses.load_kg, parameters) / sigma[:, None, None]
        columns = slopes.reshape(-1, len(parameters))
        size = np.linalg.norm(columns, axis=0)
        step = (
            np.linalg.lstsq(columns / size, (residual / sigma[:, None]).ravel(), rcond=None)[0]
            / size
        )
        before = cost
        for _ in range(_HALVINGS):
            tried = arm.moved(parameters, step)
            left = poses.point_m - tried.points(poses.position, poses.load_kg)
            if (now := _cost(left, sigma)) <= cost:
                arm, residual, cost = tried, left, now
                break
            step = step / 2.0
        if before - cost <= _CONVERGED * cost:
            break
    else:
        raise EstimationError(
            f"{poses.name}: the fit does not converge: check that joint positions, points and"
            " robot file belong together, and the signs and units",
            code="RID-KINEMATICS-POSES",
        )
    slopes = arm.slopes(poses.position, poses.load_kg, parameters) / sigma[:, None, None]
    columns = slopes.reshape(-1, len(parameters))
    size = np.linalg.norm(columns, axis=0)
    covariance = np.linalg.pinv((columns / size).T @ (columns / size), hermitian=True)
    return ArmFit(
        arm,
        tuple(parameters),
        covariance / np.outer(size, size),
        residual,
        residual / sigma[:, None],
    )


def _cost(residual: FloatArray, sigma: FloatArray) -> float:
    return float(np.sum((residual / sigma[:, np.newaxis]) ** 2))
