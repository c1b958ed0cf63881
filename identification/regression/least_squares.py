"""Weighted least squares by QR, block by block, with the solution's covariance (theory: section 9).

Huber's weights reduce the effect of rows with large residuals (Huber 1964).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Final

import numpy as np
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dgeqrf, dgeqrf_lwork, dtrcon

from config.arrays import BoolArray, FloatArray, IntArray
from config.errors import EstimationError

HUBER_LIMIT: Final = 1.345
"""Huber's limit [standard deviations]: 95 % as efficient as least squares for Gaussian noise."""

_NORMAL_MAD: Final = 0.6744897501960817
_SINGULAR: Final = 1e-10
_NEARLY_SINGULAR: Final = 1e-7


def triangular_factor(matrix: FloatArray) -> FloatArray:
    """Return R of the QR factorisation of a matrix, shape (min(rows, columns), columns).

    Raises:
        EstimationError: The matrix contains a value that is not finite.
    """
    return _factor_in_place(np.array(matrix, order="F"))


def _factor_in_place(work: FloatArray) -> FloatArray:
    """Return the factor R of a Fortran-ordered matrix, and overwrite the matrix."""
    rows, columns = work.shape
    if rows == 0:
        return work
    size = int(dgeqrf_lwork(rows, columns)[0])
    factor, _, _, info = dgeqrf(work, lwork=size, overwrite_a=1)
    if info != 0 or not np.isfinite(factor[: min(rows, columns)]).all():
        raise EstimationError(
            "the equations contain a value that is not finite: check the recording for invalid"
            " values",
            code="RID-RECORDING-DAMAGED",
        )
    upper = factor[: min(rows, columns)]
    return np.where(_below_diagonal(*upper.shape), 0.0, upper)


@lru_cache(maxsize=256)
def _below_diagonal(rows: int, columns: int) -> BoolArray:
    """Return a mask of the elements below the diagonal of a matrix of this shape."""
    return np.tri(rows, columns, -1, dtype=np.bool_)


@dataclass(frozen=True, eq=False)
class Triangle:
    """The R factor of [A y] for all rows so far, which is all information that least squares needs.

    Attributes:
        factor: Shape (at most c + 1, c + 1). R of the QR factorisation of [A y]; the last column
            belongs to y.
        columns: Shape (c,). Indices of the parameters on which the rows depend; all other columns
            of A are zero and left out.
        parameters: The number of all parameters, p.
        rows: Number of rows that were added.
    """

    factor: FloatArray
    columns: IntArray
    parameters: int
    rows: int = 0

    @classmethod
    def empty(cls, parameters: int, columns: IntArray | None = None) -> Triangle:
        """Return a triangle without rows."""
        columns = np.arange(parameters) if columns is None else columns
        return cls(np.zeros((0, len(columns) + 1)), columns, parameters)

    def add(self, matrix: FloatArray, rhs: FloatArray, rows: int | None = None) -> Triangle:
        """Return the triangle with a block added: `matrix` (rows, c), `rhs` (rows,).

        `rows` is the number of independent equations of the block, by default the number of its
        rows. It is smaller if unknown torques were eliminated from the block.
        """
        if len(rhs) == 0:
            return self
        known, width = len(self.factor), len(self.columns)
        stacked = np.empty((known + len(rhs), width + 1), order="F")
        stacked[:known] = self.factor
        stacked[known:, :width] = matrix
        stacked[known:, width] = rhs
        rows = len(rhs) if rows is None else rows
        factor = _factor_in_place(stacked)
        return Triangle(factor, self.columns, self.parameters, self.rows + rows)

    def reduced(self, kept: IntArray) -> Triangle:
        """Return the equations with the ascending parameters `kept` only; the others are zero."""
        own = np.isin(self.columns, kept)
        places = np.searchsorted(kept, self.columns[own])
        return Triangle(self.factor[:, np.append(own, True)], places, len(kept), self.rows)

    def full(self) -> FloatArray:
        """Return the factor with a column for every parameter, shape (any, p + 1)."""
        wide = np.zeros((len(self.factor), self.parameters + 1))
        wide[:, self.columns] = self.factor[:, :-1]
        wide[:, -1] = self.factor[:, -1]
        return wide

    def residual_sum(self, values: FloatArray) -> float:
        """Return the sum of squares of y - A x over all rows, for any x of shape (p,)."""
        rest = self.factor[:, -1] - self.factor[:, :-1] @ values[self.columns]
        return float(np.sum(rest**2))


@dataclass(frozen=True, eq=False)
class Solution:
    """A weighted least-squares solution.

    Attributes:
        values: Shape (p,). The minimiser.
        rows: Number of equations used.
        factor: Shape (p + 1, p + 1). R of the QR factorisation of the weighted [A y].
    """

    values: FloatArray
    rows: int
    factor: FloatArray

    @cached_property
    def covariance(self) -> FloatArray:
        """(A^T W A)^-1, shape (p, p): the covariance if weights are one over the variance."""
        p = len(self.values)
        inverse = solve_triangular(self.factor[:p, :p], np.eye(p))
        return np.asarray(inverse @ inverse.T)

    @cached_property
    def condition_number(self) -> float:
        """Condition number of the weighted matrix, columns scaled to length one (2.25, 2.26)."""
        p = len(self.values)
        upper = self.factor[:p, :p]
        singular = np.linalg.svd(upper / np.linalg.norm(upper, axis=0), compute_uv=False)
        return float(singular[0] / singular[-1])

    @property
    def information(self) -> FloatArray:
        """A^T W A, shape (p, p)."""
        upper = self.factor[:-1, :-1]
        return np.asarray(upper.T @ upper)

    def leading(self, count: int) -> tuple[FloatArray, float]:
        """Return the minimiser with only the first `count` parameters, and its cost.

        The other parameters are zero; the cost is the remaining weighted sum of squares.
        """
        values = solve_triangular(self.factor[:count, :count], self.factor[:count, -1])
        return values, float(np.sum(self.factor[count:, -1] ** 2))


def solve(
    triangles: Iterable[Triangle], weights: Iterable[float], names: tuple[str, ...]
) -> Solution:
    """Solve the equations of several channels together, each weighted by 1 / sigma.

    Args:
        triangles: Triangle of each channel.
        weights: One over the standard deviation of each channel's rows.
        names: The parameters' names, for error messages.

    Raises:
        EstimationError: There are not more equations than parameters, the motion does not determine
            a parameter, or a value is not finite.
    """
    parts = list(triangles)
    rows = sum(part.rows for part in parts)
    p = len(names)
    if rows <= p:
        raise EstimationError(
            f"only {rows} equations remain for {p} parameters: record longer, or leave out fewer"
            " samples",
            code="RID-RECORDING-SHORT",
        )
    stacked = np.vstack([w * part.full() for w, part in zip(weights, parts, strict=True)])
    factor = triangular_factor(stacked)
    upper, rhs = factor[:p, :p], factor[:p, p]
    size = np.linalg.norm(upper, axis=0)
    if upper.shape != (p, p) or (size == 0.0).any():
        hidden = [name for name, s in zip(names, size, strict=True) if s == 0.0]
        raise EstimationError(
            f"the motion does not determine {', '.join(hidden) or 'all parameters'}: use a motion"
            " that moves more axes",
            code="RID-MOTION-UNINFORMATIVE",
        )
    _check_condition(upper / size, names)
    return Solution(values=solve_triangular(upper, rhs), rows=rows, factor=factor)


def _check_condition(upper: FloatArray, names: tuple[str, ...]) -> None:
    """Refuse equations with nearly dependent parameters; columns have length one."""
    reciprocal, _ = dtrcon(upper)
    if (
        reciprocal > _NEARLY_SINGULAR
    ):  # a fast estimate; singular values are not needed in this case
        return
    _, singular, right = np.linalg.svd(upper)
    if singular[-1] < _SINGULAR * singular[0]:
        culprits = [names[j] for j in np.argsort(-np.abs(right[-1]))[:3]]
        raise EstimationError(
            f"the motion does not distinguish {', '.join(culprits)} from each other (condition"
            f" number {singular[0] / max(singular[-1], 1e-300):.1e}): move more axes, or move"
            " them further",
            code="RID-MOTION-UNINFORMATIVE",
        )


def huber_weights(residual: FloatArray) -> FloatArray:
    """Return weights min(1, 1.345 s / |r|), with s the residuals' robust standard deviation.

    Args:
        residual: Shape (rows,). Residuals of one kind; s is their median magnitude over 0.6745.
    """
    size = np.abs(residual)
    if size.size == 0:
        return size
    limit = HUBER_LIMIT * float(np.median(size)) / _NORMAL_MAD
    return np.asarray(np.minimum(1.0, limit / np.maximum(size, max(limit, 1e-300))))
