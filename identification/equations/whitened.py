"""`WhitenedEquations`: equations on DFT bins over their noise, ready for least squares."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import zip_longest

import numpy as np

from config.arrays import FloatArray
from identification.equations.base_wrench import BaseWrenchEquations, both_parts
from identification.equations.bins import BinEquations
from identification.regression.intervals import Cluster

NEGLIGIBLE_SIGMAS = 0.1


@dataclass(frozen=True, eq=False)
class WhitenedEquations:
    """The equations of one measured output with unit noise, its free torque projected out.

    An output is a joint's torque, or one of the uncorrelated combinations of the base wrench.

    Attributes:
        matrix: Shape (2 H + 1, b). Whitened regressor.
        rhs: Shape (2 H + 1,). Whitened torque or wrench.
        sigma: Shape (2 H + 1,). Standard deviation that each row was divided by [N m or N].
        rows: Equations left after the free torque has taken its own.
    """

    matrix: FloatArray
    rhs: FloatArray
    sigma: FloatArray
    rows: int

    @property
    def noise_power(self) -> float:
        """Mean square that noise alone leaves of the output."""
        return float(np.sum(self.sigma**2) * self.rows / len(self.rhs))

    def reweighted(self, weights: FloatArray) -> WhitenedEquations:
        """Return the rows times the roots of some weights."""
        root = np.sqrt(weights)
        return replace(self, matrix=self.matrix * root[:, np.newaxis], rhs=self.rhs * root)

    def widened(self, columns: FloatArray) -> WhitenedEquations:
        """Return the rows with further columns (2 H + 1, any) of unknowns."""
        return replace(self, matrix=np.column_stack([self.matrix, columns]))

    def scaled(self, factor: float) -> WhitenedEquations:
        """Return the rows of an output that measures a factor more than the model's."""
        return replace(self, matrix=factor * self.matrix)

    def residual(self, values: FloatArray) -> FloatArray:
        """Return the whitened residual of some parameters, shape (2 H + 1,)."""
        return np.asarray(self.rhs - self.matrix @ values)


def whiten(
    equations: BinEquations, inertia: FloatArray, *, uniform: bool = False
) -> tuple[WhitenedEquations, ...]:
    """Return each joint's equations over their noise.

    Args:
        equations: Equations of a period.
        inertia: Shape (n, n). Size of the joint-space inertia [kg m^2], through which the noise of
            the position's second derivative becomes torque; zero leaves the torque's own noise.
        uniform: Divide all rows by the same number, the noise's RMS (ordinary least squares).
    """
    omega = 2.0 * np.pi / equations.period_s * np.arange(equations.harmonics + 1)
    variance = inertia**2 @ equations.position_sigma**2 * omega**4
    # Where a simulation has no noise at all, every row counts alike.
    floor = 1e-9 * float(np.linalg.norm(equations.rhs)) + 1e-150
    sigma = np.sqrt(equations.torque_sigma**2 + both_parts(variance.T).T + floor**2)
    if uniform:
        sigma = np.full_like(sigma, float(np.sqrt(np.mean(sigma**2))))
    white = []
    for j, free in enumerate(equations.free):
        weight = 1.0 / sigma[j]
        matrix = equations.matrix[j] * weight[:, np.newaxis]
        rhs = equations.rhs[j] * weight
        basis = _significant(free * weight[:, np.newaxis] * np.linalg.norm(equations.rhs[j]))
        matrix = matrix - basis @ (basis.T @ matrix)
        rhs = rhs - basis @ (basis.T @ rhs)
        white.append(WhitenedEquations(matrix, rhs, sigma[j], len(rhs) - basis.shape[1]))
    return tuple(white)


def whiten_base_wrench(
    reaction: BaseWrenchEquations, *, uniform: bool = False
) -> tuple[WhitenedEquations, ...]:
    """Return a plate's equations over their noise, as mutually uncorrelated outputs.

    With `uniform` the noise is taken for white; N and N m still need its size to be compared.
    """
    covariance = reaction.covariance.copy()
    if uniform:
        covariance[1:] = covariance[1:].mean(axis=0)
    # Where a simulation has no noise at all, every row counts alike.
    size = 1e-9 * np.linalg.norm(reaction.rhs, axis=1) + 1e-12
    covariance = covariance + np.diag(size**2)
    bins = np.arange(len(covariance))
    factor = np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
    factor = factor[np.concatenate([bins, bins[1:]])]
    whole = np.concatenate([reaction.matrix, reaction.rhs[:, :, np.newaxis]], axis=2)
    white = np.asarray(np.linalg.solve(factor, whole.transpose(1, 0, 2)), dtype=np.float64)
    return tuple(
        WhitenedEquations(white[:, r, :-1], white[:, r, -1], factor[:, r, r], len(white))
        for r in range(white.shape[1])
    )


def _significant(free: FloatArray) -> FloatArray:
    """Return an orthonormal basis of what free torque can do to whitened rows, shape (rows, any).

    Each column is a piece of free torque as large as the joint's RMS torque; what stays under a
    tenth of the noise even then is not worth an equation.
    """
    basis, size, _ = np.linalg.svd(free, full_matrices=False)
    return np.asarray(basis[:, size > NEGLIGIBLE_SIGMAS])


def residual_covariance(
    white: Iterable[tuple[WhitenedEquations, ...]], values: FloatArray, covariance: FloatArray
) -> FloatArray:
    """Return the covariance that residuals taken for white show, output by output, shape (b, b).

    Args:
        white: The equations of each period average.
        values: Shape (b,). The estimate.
        covariance: Shape (b, b). Its covariance by the measured noise, (A^T A)^-1.
    """
    meat = np.zeros_like(covariance)
    for outputs in zip_longest(*white):  # a plate whose channel was left out has fewer
        joint = [part for part in outputs if part is not None]
        grams = [part.matrix.T @ part.matrix for part in joint]
        gram = np.sum(grams, axis=0)
        freedom = sum(part.rows for part in joint) - float(np.sum(gram * covariance))
        power = sum(float(np.sum(part.residual(values) ** 2)) for part in joint)
        meat += power / max(freedom, 1.0) * gram
    return np.asarray(covariance @ meat @ covariance)


def bin_clusters(
    white: Iterable[tuple[WhitenedEquations, ...]], values: FloatArray
) -> Iterator[Cluster]:
    """Yield each frequency bin of each period average, all outputs together, as a cluster."""
    for parts in white:
        bins = both_parts(np.arange(len(parts[0].rhs) // 2 + 1, dtype=np.float64))
        residuals = [part.residual(values) for part in parts]
        for number in range(int(bins[-1]) + 1):
            rows = bins == number
            yield Cluster.of(
                np.vstack([part.matrix[rows] for part in parts]),
                np.concatenate([residual[rows] for residual in residuals]),
            )
