"""Metric of distances from an estimate: its covariance, modified to have full rank."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular

from config.arrays import FloatArray
from config.errors import EstimationError
from identification.estimation.estimate import Estimate


def jackknife_metric(estimate: Estimate) -> tuple[FloatArray, FloatArray]:
    """Return the estimate's sigmas and the Cholesky factor of its correlations.

    The cluster-robust covariance of a short recording is singular, because its rank is at most the
    number of clusters. Therefore its sigmas are used with averaged correlations: half its own, half
    those of white residuals, which have full rank (shrinkage towards a target, Ledoit and Wolf
    2004).

    Returns:
        `sigma`, shape (b,). Standard deviations.
        `factor`, shape (b, b). Lower triangular.

    Raises:
        EstimationError: The covariances are not positive definite.
    """
    try:
        correlation = sum(
            0.5 * covariance / np.sqrt(np.outer(np.diagonal(covariance), np.diagonal(covariance)))
            for covariance in (estimate.covariance_jackknife, estimate.covariance_residual)
        )
        return estimate.sigma, np.array(np.linalg.cholesky(correlation), dtype=float)
    except (np.linalg.LinAlgError, FloatingPointError):
        raise EstimationError(
            "the estimate's covariances are not positive definite, so distances from it cannot"
            " be computed: estimate again from the recordings",
            code="RID-MODEL-UNSOUND",
        ) from None


def full_rank_covariance(estimate: Estimate) -> FloatArray:
    """Return the covariance of `jackknife_metric`, shape (b, b)."""
    sigma, factor = jackknife_metric(estimate)
    spread = sigma[:, np.newaxis] * factor
    return np.asarray(spread @ spread.T)


def whiten_parameters(estimate: Estimate, values: FloatArray) -> FloatArray:
    """Return base parameters, (b, ...), in decorrelated standard deviations."""
    sigma, factor = jackknife_metric(estimate)
    scaled = values / sigma.reshape(-1, *(1,) * (values.ndim - 1))
    return np.asarray(solve_triangular(factor, scaled, lower=True))
