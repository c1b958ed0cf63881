"""`WhiteEquations`: equations on DFT bins over their noise, ready for least squares."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.arrays import FloatArray
from identification.bin_equations import BinEquations, both_parts

NEGLIGIBLE_SIGMAS = 0.1
OCTAVES = 3
FEWEST_FREEDOMS = 6.0


@dataclass(frozen=True, eq=False)
class WhiteEquations:
    """The equations of one joint with unit noise, and with its free torque projected out.

    Attributes
    ----------
    matrix : ndarray, shape (2 H + 1, b)
        Whitened regressor.
    rhs : ndarray, shape (2 H + 1,)
        Whitened torque.
    sigma : ndarray, shape (2 H + 1,)
        Standard deviation that each row was divided by [N m or N].
    rows : int
        Equations left after the free torque has taken its own.
    """

    matrix: FloatArray
    rhs: FloatArray
    sigma: FloatArray
    rows: int

    def residual(self, values: FloatArray) -> FloatArray:
        """Return the whitened residual of some parameters, shape (2 H + 1,)."""
        return np.asarray(self.rhs - self.matrix @ values)


def whiten(equations: BinEquations, inertia: FloatArray) -> tuple[WhiteEquations, ...]:
    """Return each joint's equations over their noise.

    Parameters
    ----------
    equations : BinEquations
        Equations of a period.
    inertia : ndarray, shape (n, n)
        Size of the joint-space inertia [kg m^2], through which the noise of the position's second
        derivative becomes torque; zero leaves the torque's own noise.
    """
    omega = 2.0 * np.pi / equations.period_s * np.arange(equations.harmonics + 1)
    variance = inertia**2 @ equations.position_sigma**2 * omega**4
    # Where a simulation has no noise at all, every row counts alike.
    floor = 1e-9 * float(np.linalg.norm(equations.rhs)) + 1e-150
    sigma = np.sqrt(equations.torque_sigma**2 + both_parts(variance.T).T + floor**2)
    white = []
    for j, free in enumerate(equations.free):
        weight = 1.0 / sigma[j]
        matrix = equations.matrix[j] * weight[:, np.newaxis]
        rhs = equations.rhs[j] * weight
        basis = _significant(free * weight[:, np.newaxis] * np.linalg.norm(equations.rhs[j]))
        matrix = matrix - basis @ (basis.T @ matrix)
        rhs = rhs - basis @ (basis.T @ rhs)
        white.append(WhiteEquations(matrix, rhs, sigma[j], len(rhs) - basis.shape[1]))
    return tuple(white)


def _significant(free: FloatArray) -> FloatArray:
    """Return an orthonormal basis of what free torque can do to whitened rows, shape (rows, any).

    Each column is a piece of free torque as large as the joint's RMS torque; what stays under a
    tenth of the noise even then is not worth an equation.
    """
    basis, size, _ = np.linalg.svd(free, full_matrices=False)
    return np.asarray(basis[:, size > NEGLIGIBLE_SIGMAS])


def residual_covariance(
    white: Iterable[tuple[WhiteEquations, ...]], values: FloatArray, covariance: FloatArray
) -> FloatArray:
    """Return the covariance that the residuals show instead of the measured noise, shape (b, b).

    The residual's power is taken joint by joint and octave by octave: model error is largest where
    the motion is, at low frequency, and must not be diluted by the quiet rest of the band.

    Parameters
    ----------
    white : iterable of tuple of WhiteEquations
        The equations of each period average.
    values : ndarray, shape (b,)
        The estimate.
    covariance : ndarray, shape (b, b)
        Its covariance by the measured noise, (A^T A)^-1.
    """
    meat = np.zeros_like(covariance)
    for part in (part for parts in white for part in parts if part.rows > 0):
        error = part.residual(values)
        kept_share = part.rows / len(part.rhs)
        for rows in _octaves(part, covariance, kept_share):
            matrix = part.matrix[rows]
            freedom = _freedom(matrix, covariance, kept_share)
            meat += np.sum(error[rows] ** 2) / max(freedom, 1.0) * (matrix.T @ matrix)
    return np.asarray(covariance @ meat @ covariance)


def _octaves(
    part: WhiteEquations, covariance: FloatArray, kept_share: float
) -> list[NDArray[np.bool_]]:
    """Return which rows form a group, low to high; a group poor in freedom joins the next."""
    harmonics = len(part.rhs) // 2
    bins = both_parts(np.arange(harmonics + 1, dtype=float))
    upper = [harmonics / 2.0**octave for octave in range(OCTAVES, -1, -1)]
    groups: list[NDArray[np.bool_]] = []
    below = -1.0
    for end in upper:
        rows = (bins > below) & (bins <= end)
        if _freedom(part.matrix[rows], covariance, kept_share) >= FEWEST_FREEDOMS:
            groups.append(rows)
            below = end
    if groups and below < harmonics:
        groups[-1] |= bins > below
    return groups or [np.ones(len(bins), dtype=np.bool_)]


def _freedom(matrix: FloatArray, covariance: FloatArray, kept_share: float) -> float:
    """Return the rows' degrees of freedom: their number less what the fit took of them."""
    return float(len(matrix) * kept_share - np.sum((matrix @ covariance) * matrix))
