"""Intervals that hold although the residuals are coloured: model error is not white noise.

What a model does not have shows in the residuals as something correlated from row to row and joint
to joint. Rows are therefore put into clusters, a bin of the spectrum or a stretch of time, and the
estimate's scatter is what leaving out one cluster after the other does to it: the cluster jackknife
(MacKinnon, Nielsen and Webb 2023, CV3). Unlike the sandwich of plain residuals it does not take a
residual for small because the fit bent towards it. Few clusters carry most of the information about
some parameters; their interval is widened by Student's t with as many degrees of freedom as there
are effective clusters (Carter, Schnepel and Steigerwald 2017), less one.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm, t

from acquisition.arrays import FloatArray
from config.errors import EstimationError

COVERAGE = 0.954499736  # of two standard deviations


@dataclass(frozen=True, eq=False)
class Cluster:
    """The weighted equations of one cluster, condensed.

    Attributes
    ----------
    gram : ndarray, shape (p, p)
        A^T W A of its rows.
    score : ndarray, shape (p,)
        A^T W r of its rows, r the residuals.
    """

    gram: FloatArray
    score: FloatArray

    @classmethod
    def of(cls, matrix: FloatArray, residual: FloatArray) -> Cluster:
        """Condense whitened rows (rows, p) and their residuals (rows,)."""
        return cls(matrix.T @ matrix, matrix.T @ residual)


def jackknife(
    information: FloatArray, clusters: Iterable[Cluster]
) -> tuple[FloatArray, FloatArray]:
    """Return the covariance that leaving out clusters shows, and its degrees of freedom.

    Parameters
    ----------
    information : ndarray, shape (p, p)
        A^T W A of all rows, a prior's included.
    clusters : iterable of Cluster
        They are gone through once.

    Returns
    -------
    covariance : ndarray, shape (p, p)
        Of the estimate.
    freedom : ndarray, shape (p,)
        Effective clusters behind each parameter, less one; at least 1.

    Raises
    ------
    EstimationError
        Fewer than two clusters.
    """
    scale = np.sqrt(np.diagonal(information))
    normal = information / np.outer(scale, scale)
    inverse = np.linalg.inv(normal)
    spread = np.zeros_like(normal)
    total, squares = np.zeros(len(scale)), np.zeros(len(scale))
    count = 0
    for cluster in clusters:
        count += 1
        gram = cluster.gram / np.outer(scale, scale)
        change = np.linalg.lstsq(normal - gram, cluster.score / scale, rcond=1e-12)[0]
        spread += np.outer(change, change)
        share = np.einsum("ij,jk,ki->i", inverse, gram, inverse)
        total += share
        squares += share**2
    if count < 2:
        raise EstimationError(
            "the intervals need at least two stretches of the recording that differ: record longer"
        )
    covariance = (count - 1) / count * spread / np.outer(scale, scale)
    freedom = np.maximum(total**2 / np.maximum(squares, 1e-300) - 1.0, 1.0)
    return np.asarray(covariance), freedom


def widening(freedom: FloatArray) -> FloatArray:
    """Return what a standard deviation is multiplied by, so that two of them cover 95 %."""
    probability = 0.5 + COVERAGE / 2.0
    return np.asarray(t.ppf(probability, freedom) / norm.ppf(probability))
