"""Weighted least squares by QR, fed block by block, with both covariances (physics: section 9)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from acquisition.arrays import FloatArray
from config.errors import EstimationError


def triangular_factor(matrix: FloatArray) -> FloatArray:
    """Return R of the QR factorisation of a matrix, shape (min(rows, columns), columns)."""
    factor: FloatArray = np.asarray(np.linalg.qr(matrix, mode="r"))
    return factor


@dataclass(frozen=True, eq=False)
class Triangle:
    """The R factor of [A y] for all rows seen so far: all that least squares needs of them.

    Attributes
    ----------
    factor : ndarray, shape (at most p + 1, p + 1)
        R of the QR factorisation of [A y]; the last column belongs to y.
    rows : int
        Rows behind it.
    """

    factor: FloatArray
    rows: int = 0

    @classmethod
    def empty(cls, parameters: int) -> Triangle:
        """Return the triangle of no rows at all."""
        return cls(np.zeros((0, parameters + 1)))

    def add(self, matrix: FloatArray, rhs: FloatArray, rows: int | None = None) -> Triangle:
        """Return the triangle with a block added: `matrix` (rows, p), `rhs` (rows,).

        `rows` says how many equations the block is worth, where some of it is projected out.
        """
        if len(rhs) == 0:
            return self
        stacked = np.vstack([self.factor, np.column_stack([matrix, rhs])])
        rows = len(rhs) if rows is None else rows
        return Triangle(triangular_factor(stacked), self.rows + rows)

    def residual_sum(self, values: FloatArray) -> float:
        """Return the sum of squares of y - A x over all rows, for any x of shape (p,)."""
        return float(np.sum((self.factor[:, -1] - self.factor[:, :-1] @ values) ** 2))


@dataclass(frozen=True, eq=False)
class Solution:
    """A weighted least-squares solution.

    Attributes
    ----------
    values : ndarray, shape (p,)
        The minimiser.
    covariance : ndarray, shape (p, p)
        (A^T W A)^-1: the covariance where the weights are one over the noise's variance.
    condition_number : float
        Of the weighted matrix with its columns scaled to length one (2.25, 2.26).
    rows : int
        Equations used.
    """

    values: FloatArray
    covariance: FloatArray
    condition_number: float
    rows: int


def solve(
    triangles: Iterable[Triangle], weights: Iterable[float], names: tuple[str, ...]
) -> Solution:
    """Solve the equations of several channels together, each weighted by 1 / sigma.

    Parameters
    ----------
    triangles : iterable of Triangle
        One a channel.
    weights : iterable of float
        One over the standard deviation of each channel's rows.
    names : tuple of str
        The parameters, for the message where one is not seen.

    Raises
    ------
    EstimationError
        Fewer equations than parameters, or a parameter that this motion does not show.
    """
    parts = list(triangles)
    rows = sum(part.rows for part in parts)
    p = len(names)
    if rows <= p:
        raise EstimationError(
            f"{rows} equations are left for {p} parameters: record longer, or leave out fewer"
            " samples"
        )
    stacked = np.vstack([w * part.factor for w, part in zip(weights, parts, strict=True)])
    factor = triangular_factor(stacked)
    upper, rhs = factor[:p, :p], factor[:p, p]
    size = np.linalg.norm(upper, axis=0)
    if upper.shape != (p, p) or (size == 0.0).any():
        hidden = [name for name, s in zip(names, size, strict=True) if s == 0.0]
        raise EstimationError(f"the motion does not show {', '.join(hidden) or 'all parameters'}")
    _, singular, right = np.linalg.svd(upper / size)
    if singular[-1] < 1e-10 * singular[0]:
        culprits = [names[j] for j in np.argsort(-np.abs(right[-1]))[:3]]
        raise EstimationError(
            f"the motion does not tell {', '.join(culprits)} from one another (condition number"
            f" {singular[0] / max(singular[-1], 1e-300):.1e}): move more axes, or further"
        )
    inverse = solve_triangular(upper, np.eye(p))
    return Solution(
        values=solve_triangular(upper, rhs),
        covariance=inverse @ inverse.T,
        condition_number=float(singular[0] / singular[-1]),
        rows=rows,
    )


def sandwich(covariance: FloatArray, scores: FloatArray, rows: int) -> FloatArray:
    """Return the covariance that the residuals themselves show, whatever their colour.

    Residuals of the same cluster (a frequency bin, a stretch of time) may be correlated and of any
    size; those of different clusters are taken as independent (the cluster-robust sandwich).

    Parameters
    ----------
    covariance : ndarray, shape (p, p)
        (A^T W A)^-1.
    scores : ndarray, shape (clusters, p)
        A_c^T W r_c of every cluster c.
    rows : int
        Equations behind them.
    """
    clusters, p = scores.shape
    if clusters <= 1 or rows <= p:
        raise EstimationError(
            f"{clusters} clusters of {rows} residuals say nothing of {p} parameters' scatter"
        )
    correction = clusters / (clusters - 1) * (rows - 1) / (rows - p)
    half = scores @ covariance
    return np.asarray(correction * (half.T @ half))
