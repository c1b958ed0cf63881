"""`FlexibleFit`: a fit with friction that also depends on the load and the cube root of the speed.

Most of a simple model's residual is friction that the model does not contain. It hides the residual
from wrong lengths, axes, gears and clocks. With the additional friction terms, that residual
becomes visible. The recordings are divided into ten parts, and each part is predicted from the
others.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from config.arrays import BoolArray, FloatArray
from dynamics.model.robot_model import regressor
from identification.wiring.signals import WiredSignals
from identification.wiring.trial import FEWEST_ROWS, plain_model, rows_used

PARTS: Final = 10
PASSES: Final = 4
PASSES_FROM_KNOWN: Final = 2
RIDGE: Final = 1e-8
SMALLEST_SHARE: Final = 0.003
SLOW_SHARE: Final = 0.1
ROWS_PER_PARAMETER: Final = 8
UNKNOWN: Final = 1e200
"""Variance of a joint at rest, so that its rows have no weight."""


@dataclass(frozen=True, eq=False)
class FlexibleFit:
    """Squared residuals of the parts, divided by the variances of the joints' residuals.

    Attributes:
        fitted, held_out: Shape (parts,). Squared residuals in the fit to all parts, and in the fit
            to the other parts.
        rigid_nm: Shape (rows, n). Torque of the links and rotors, which loads the gears [N m or N].
        variance: Shape (n,). Variance of each joint's residual, for the weights of its rows.
        held_out_share: Shape (n,). RMS residual of each joint on held-out parts, relative to its
            RMS torque; zero for joints at rest.
        parts: The rows of each part, one after the other.
    """

    fitted: FloatArray
    held_out: FloatArray
    rigid_nm: FloatArray
    variance: FloatArray
    held_out_share: FloatArray
    parts: tuple[slice, ...]

    @classmethod
    def of(cls, signals: WiredSignals) -> FlexibleFit | None:
        """Fit signals, with each joint weighted by its residual.

        Returns:
            None if there are too few rows, or if most joints are at rest: then any axis explains
                the other joints' torques.
        """
        use = _rows(signals)
        of_rows = use.sum(axis=1)
        if of_rows.sum() < PARTS * FEWEST_ROWS or 2 * use.any(axis=0).sum() < use.shape[1] + 1:
            return None
        ends = np.searchsorted(np.cumsum(of_rows), np.arange(1, PARTS) * of_rows.sum() / PARTS)
        parts = tuple(slice(*pair) for pair in pairwise([0, *ends.tolist(), len(use)]))
        size = np.sum(np.square(signals.torque_nm), axis=0, where=use)
        rows = np.maximum(use.sum(axis=0), 1)
        variance = np.where(size > 0.0, size / rows, UNKNOWN)
        floor = SMALLEST_SHARE**2 * variance
        equations, rigid_nm = _Equations(signals, use, parts), signals.torque_nm
        if of_rows.sum() < ROWS_PER_PARAMETER * equations.parameters:
            return None
        for _ in range(PASSES - 1):
            equations.load(rigid_nm)
            residual, rigid_nm = equations.solve(variance)
            left = np.sum(np.square(residual), axis=0, where=use) / rows
            variance = np.where(size > 0.0, np.maximum(left, floor), UNKNOWN)
        return cls._of(equations, rigid_nm, variance, 1)

    def fit_other(self, signals: WiredSignals, torque: FloatArray) -> FlexibleFit:
        """Fit the same rows of corrected signals, with `torque` (n, n) times the old torques."""
        equations = _Equations(signals, _rows(signals), self.parts)
        variance = np.square(torque) @ self.variance
        return self._of(equations, self.rigid_nm @ torque.T, variance, PASSES_FROM_KNOWN)

    @classmethod
    def _of(
        cls, equations: _Equations, rigid_nm: FloatArray, variance: FloatArray, passes: int
    ) -> FlexibleFit:
        residual = rigid_nm
        for _ in range(passes):
            equations.load(rigid_nm)
            residual, rigid_nm = equations.solve(variance)
        predicted = equations.predict(variance)
        return cls(
            equations.squares(residual, variance),
            equations.squares(predicted, variance),
            rigid_nm,
            variance,
            equations.share(predicted),
            equations.parts,
        )


class _Equations:
    """Columns of all joints' rows, and sums of their products over each part."""

    def __init__(self, signals: WiredSignals, use: BoolArray, parts: tuple[slice, ...]) -> None:
        model = plain_model(signals)
        phi, speed = regressor(model, *signals.joints()), signals.velocity
        self._use, self._torque, self._speed = use, signals.torque_nm, speed
        self._own = model.parameter_groups["rigid_body"]
        n = phi.shape[1]
        roots = np.cbrt(speed / np.maximum(np.sqrt(np.mean(np.square(speed), axis=0)), 1e-12))
        of_joints = np.zeros((len(phi), n, 2 * n))
        joints = np.arange(n)
        of_joints[:, joints, joints] = roots
        self._columns = np.concatenate([phi, of_joints], axis=2)
        self.parts, self.parameters = parts, self._columns.shape[2]

    def load(self, rigid_nm: FloatArray) -> None:
        """Set the columns of load-dependent friction for a gear torque (rows, n)."""
        n = rigid_nm.shape[1]
        joints = np.arange(n)
        loaded = np.abs(rigid_nm) * np.sign(self._speed)
        self._columns[:, joints, self._columns.shape[2] - n + joints] = loaded

    def solve(self, variance: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the residual and the rigid-body torque of a fit to all parts, each (rows, n)."""
        grams, rhs = self._sums(variance)
        values = _solve_ridge(grams.sum(axis=0), rhs.sum(axis=0))
        rigid_nm = self._columns[:, :, self._own] @ values[self._own]
        return self._torque - self._columns @ values, rigid_nm

    def predict(self, variance: FloatArray) -> FloatArray:
        """Return the residual (rows, n) in which each part is predicted by a fit to other parts."""
        grams, rhs = self._sums(variance)
        residual = np.zeros_like(self._torque)
        for k, part in enumerate(self.parts):
            values = _solve_ridge(grams.sum(axis=0) - grams[k], rhs.sum(axis=0) - rhs[k])
            residual[part] = self._torque[part] - self._columns[part] @ values
        return residual

    def squares(self, residual: FloatArray, variance: FloatArray) -> FloatArray:
        """Return the weighted sum of squares of each part."""
        weighted = np.sum(np.square(residual) / variance, axis=1, where=self._use)
        return np.array([weighted[part].sum() for part in self.parts])

    def share(self, residual: FloatArray) -> FloatArray:
        """Return each joint's RMS residual relative to its RMS torque, (n,)."""
        left, size = (
            np.sum(np.square(each), axis=0, where=self._use) for each in (residual, self._torque)
        )
        shares = np.divide(left, size, out=np.zeros_like(left), where=size > 0.0)
        return np.asarray(np.sqrt(shares))

    def _sums(self, variance: FloatArray) -> tuple[FloatArray, FloatArray]:
        weight = self._use / np.sqrt(variance)
        grams, rhs = [], []
        for part in self.parts:
            columns = (self._columns[part] * weight[part][:, :, np.newaxis]).reshape(
                -1, self._columns.shape[2]
            )
            grams.append(columns.T @ columns)
            rhs.append(columns.T @ (self._torque[part] * weight[part]).reshape(-1))
        return np.array(grams), np.array(rhs)


def _rows(signals: WiredSignals) -> BoolArray:
    """Return a mask of the usable rows of each joint, (rows, n): those away from standstill."""
    speed = signals.velocity
    slowest = SLOW_SHARE * np.sqrt(np.mean(np.square(speed), axis=0))
    use = rows_used(signals) & (np.abs(speed) > slowest)
    return np.asarray(use & (use.sum(axis=0) >= FEWEST_ROWS))


def _solve_ridge(gram: FloatArray, rhs: FloatArray) -> FloatArray:
    scale = np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
    scaled = gram / scale / scale[:, np.newaxis] + RIDGE * np.eye(len(scale))
    factor = cho_factor(scaled, check_finite=False)
    return np.asarray(cho_solve(factor, rhs / scale, check_finite=False) / scale)
