"""`WhitenedEquations`: equations on DFT bins divided by their noise, ready for least squares."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import zip_longest

import numpy as np

from config.arrays import FloatArray
from identification.equations.base_wrench import BaseWrenchEquations, repeat_for_real_and_imaginary
from identification.equations.bins import BinEquations
from identification.regression.intervals import Cluster

NEGLIGIBLE_SIGMAS = 0.1


@dataclass(frozen=True, eq=False)
class WhitenedEquations:
    """The equations of one measured output with unit noise, the free torque projected out.

    An output is a joint's torque, or one of the uncorrelated combinations of the base wrench.

    Attributes:
        matrix: Shape (2 H + 1, b). Whitened regressor.
        rhs: Shape (2 H + 1,). Whitened torque or wrench.
        sigma: Shape (2 H + 1,). Standard deviation by which each row was divided [N m or N].
        rows: Number of independent equations after the free torque was projected out.
    """

    matrix: FloatArray
    rhs: FloatArray
    sigma: FloatArray
    rows: int

    @property
    def noise_power(self) -> float:
        """Mean square of the residual that noise alone would cause."""
        return float(np.sum(self.sigma**2) * self.rows / len(self.rhs))

    def reweight(self, weights: FloatArray) -> WhitenedEquations:
        """Return the rows multiplied by the square roots of some weights."""
        root = np.sqrt(weights)
        return replace(self, matrix=self.matrix * root[:, np.newaxis], rhs=self.rhs * root)

    def add_columns(self, columns: FloatArray) -> WhitenedEquations:
        """Return the rows with columns (2 H + 1, any) of further unknowns."""
        return replace(self, matrix=np.column_stack([self.matrix, columns]))

    def scale_model(self, factor: float) -> WhitenedEquations:
        """Return the equations for measured values that are `factor` times the model's."""
        return replace(self, matrix=factor * self.matrix)

    def residual(self, values: FloatArray) -> FloatArray:
        """Return the whitened residual for some parameters, shape (2 H + 1,)."""
        return np.asarray(self.rhs - self.matrix @ values)


def whiten(
    equations: BinEquations, inertia: FloatArray, *, uniform: bool = False
) -> tuple[WhitenedEquations, ...]:
    """Return each joint's equations divided by their noise.

    Args:
        equations: Equations of a period.
        inertia: Shape (n, n). Magnitude of the joint-space inertia [kg m^2], through which the
            noise of the position's second derivative becomes torque noise; with zeros, only the
            noise of the torque itself counts.
        uniform: Divide all rows by the same number, the noise's RMS (ordinary least squares).
    """
    omega = 2.0 * np.pi / equations.period_s * np.arange(equations.harmonics + 1)
    variance = inertia**2 @ equations.position_sigma**2 * omega**4
    # If a simulation has no noise at all, all rows have the same weight.
    floor = 1e-9 * float(np.linalg.norm(equations.rhs)) + 1e-150
    sigma = np.sqrt(
        equations.torque_sigma**2 + repeat_for_real_and_imaginary(variance.T).T + floor**2
    )
    if uniform:
        sigma = np.full_like(sigma, float(np.sqrt(np.mean(sigma**2))))
    white = []
    for j, free in enumerate(equations.free):
        weight = 1.0 / sigma[j]
        matrix = equations.matrix[j] * weight[:, np.newaxis]
        rhs = equations.rhs[j] * weight
        basis = _significant_directions(
            free * weight[:, np.newaxis] * np.linalg.norm(equations.rhs[j])
        )
        matrix = matrix - basis @ (basis.T @ matrix)
        rhs = rhs - basis @ (basis.T @ rhs)
        white.append(WhitenedEquations(matrix, rhs, sigma[j], len(rhs) - basis.shape[1]))
    return tuple(white)


def whiten_base_wrench(
    reaction: BaseWrenchEquations, *, uniform: bool = False
) -> tuple[WhitenedEquations, ...]:
    """Return a plate's equations divided by their noise, as mutually uncorrelated outputs.

    With `uniform` the noise is assumed white; its size is still needed to compare N with N m.
    """
    covariance = reaction.covariance.copy()
    if uniform:
        covariance[1:] = covariance[1:].mean(axis=0)
    # If a simulation has no noise at all, all rows have the same weight.
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


def _significant_directions(free: FloatArray) -> FloatArray:
    """Return an orthonormal basis of the effect of free torque on whitened rows, shape (rows, any).

    Each column is the effect of a piece of free torque that is as large as the joint's RMS torque.
    If the effect in a direction stays below a tenth of the noise, this direction is ignored,
    because each direction removes one equation.
    """
    basis, size, _ = np.linalg.svd(free, full_matrices=False)
    return np.asarray(basis[:, size > NEGLIGIBLE_SIGMAS])


def residual_covariance(
    white: Iterable[tuple[WhitenedEquations, ...]], values: FloatArray, covariance: FloatArray
) -> FloatArray:
    """Return the covariance from the residuals' size, assumed white for each output, shape (b, b).

    Args:
        white: The equations of each period average.
        values: Shape (b,). The estimate.
        covariance: Shape (b, b). Covariance of the estimate due to the measured noise, (A^T A)^-1.
    """
    meat = np.zeros_like(covariance)
    for outputs in zip_longest(*white):  # fewer outputs if a channel of the plate was left out
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
        bins = repeat_for_real_and_imaginary(
            np.arange(len(parts[0].rhs) // 2 + 1, dtype=np.float64)
        )
        residuals = [part.residual(values) for part in parts]
        for number in range(int(bins[-1]) + 1):
            rows = bins == number
            yield Cluster.of(
                np.vstack([part.matrix[rows] for part in parts]),
                np.concatenate([residual[rows] for residual in residuals]),
            )
