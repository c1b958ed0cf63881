"""Intervals that hold although the residuals are coloured: model error is not white noise.

What a model does not have shows in the residuals as something correlated from row to row and joint
to joint. Rows are therefore put into clusters, a bin of the spectrum or a stretch of time, and the
estimate's scatter is what leaving out one cluster after the other does to it: the cluster jackknife
(MacKinnon, Nielsen and Webb 2023, CV3). Unlike the sandwich of plain residuals it does not take a
residual for small because the fit bent towards it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from config.arrays import FloatArray
from config.errors import EstimationError


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


def jackknife(information: FloatArray, clusters: Iterable[Cluster]) -> FloatArray:
    """Return the covariance that leaving out one cluster after the other shows.

    Parameters
    ----------
    information : ndarray, shape (p, p)
        A^T W A of all rows, a prior's included.
    clusters : iterable of Cluster
        They are gone through once.

    Returns
    -------
    ndarray, shape (p, p)
        Covariance of the estimate.

    Raises
    ------
    EstimationError
        Fewer than two clusters.
    """
    scale = np.sqrt(np.diagonal(information))
    scales = np.outer(scale, scale)
    normal = information / scales
    spread = np.zeros_like(normal)
    count = 0
    for cluster in clusters:
        count += 1
        rest = normal - cluster.gram / scales
        change = np.linalg.lstsq(rest, cluster.score / scale, rcond=1e-12)[0]
        spread += np.outer(change, change)
    if count < 2:
        raise EstimationError(
            "the intervals need at least two stretches of the recording that differ: record longer"
        )
    return np.asarray((count - 1) / count * spread / scales)
