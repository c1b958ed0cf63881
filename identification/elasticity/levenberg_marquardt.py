"""`minimise`: least squares by Levenberg-Marquardt, with a finite-difference Jacobian."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray

SETTLED: Final = 1e-6
MOST_TRIES: Final = 12
SINGULAR: Final = 1e-12


@dataclass(frozen=True, eq=False)
class Minimum:
    """A minimum of a sum of squares.

    Attributes:
        x: Shape (p,). The unknowns.
        residuals: Shape (m,). The residuals.
        jacobian: Shape (m, p). Derivatives of the residuals, before the last step.
        is_settled: True if the last step reduced the sum by less than the fraction `SETTLED`; False
            if the iterations ended before.
    """

    x: FloatArray
    residuals: FloatArray
    jacobian: FloatArray
    is_settled: bool

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the unknowns for residuals of variance 1, shape (p, p)."""
        size = np.maximum(np.linalg.norm(self.jacobian, axis=0), 1e-300)
        _, values, right = np.linalg.svd(self.jacobian / size, full_matrices=False)
        root = right.T / np.maximum(values, SINGULAR * values[0]) / size[:, np.newaxis]
        return np.asarray(root @ root.T)


def minimise(
    residuals: Callable[[FloatArray], FloatArray],
    start: FloatArray,
    steps: FloatArray,
    iterations: int,
) -> Minimum:
    """Minimise the sum of squared residuals.

    Args:
        residuals: Returns the residuals of a vector of unknowns.
        start: Shape (p,). The unknowns at the beginning.
        steps: Shape (p,). Steps of the finite differences.
        iterations: Largest number of Jacobians.
    """
    x, left, damping = start.copy(), residuals(start), 1e-4
    jacobian = np.empty((len(left), len(x)))
    is_settled = False
    for _ in range(iterations):
        for i, step in enumerate(steps):
            moved = x.copy()
            moved[i] += step
            jacobian[:, i] = (residuals(moved) - left) / step
        size = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
        basis, values, right = np.linalg.svd(jacobian / size, full_matrices=False)
        gradient, before = values * (basis.T @ left), float(left @ left)
        for _ in range(MOST_TRIES):
            trial_x = x - right.T @ (gradient / (values**2 + damping)) / size
            trial = residuals(trial_x)
            if np.isfinite(trial).all() and float(trial @ trial) < before:
                x, left, damping = trial_x, trial, 0.1 * damping
                break
            damping = max(10.0 * damping, 1e-9)
        is_settled = before - float(left @ left) <= SETTLED * before
        if is_settled:
            break
    return Minimum(x, left, jacobian, is_settled)
