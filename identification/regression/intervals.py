"""Intervals that hold although the residuals are coloured: model error is not white noise.

What a model does not have shows in the residuals as something correlated from row to row and joint
to joint. Rows are therefore put into clusters, a bin of the spectrum or a stretch of time, and the
estimate's scatter is what leaving out one cluster after the other does to it: the cluster jackknife
(MacKinnon, Nielsen and Webb 2023, CV3). Unlike the sandwich of plain residuals it does not take a
residual for small because the fit bent towards it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import ndtr, stdtrit

from config.arrays import FloatArray
from config.errors import EstimationError

FEW_CLUSTERS: Final = 30


@dataclass(frozen=True, eq=False)
class Cluster:
    """The weighted equations of one cluster, condensed.

    Attributes:
        gram: Shape (p, p). A^T W A of its rows.
        score: Shape (p,). A^T W r of its rows, r the residuals.
    """

    gram: FloatArray
    score: FloatArray

    @classmethod
    def of(cls, matrix: FloatArray, residual: FloatArray) -> Cluster:
        """Condense whitened rows (rows, p) and their residuals (rows,)."""
        return cls(matrix.T @ matrix, matrix.T @ residual)


@dataclass(frozen=True, eq=False)
class Scatter:
    """What leaving out one cluster after the other shows.

    Attributes:
        covariance: Shape (p, p). Covariance of the estimate.
        clusters: How many it rests on.
    """

    covariance: FloatArray
    clusters: int

    @property
    def quoted(self) -> FloatArray:
        """The covariance to quote, shape (p, p): two sigma of it hold with few clusters, too."""
        return self.covariance * widening(self.clusters) ** 2


def widening(clusters: int) -> float:
    """Return how many times wider two-sigma intervals are for resting on few clusters.

    A scatter of G clusters is itself uncertain, so intervals follow Student's t with G - 1 degrees
    of freedom (Cameron and Miller 2015, VI.D). From `FEW_CLUSTERS` on the difference, 4 %, is left
    out.
    """
    if clusters >= FEW_CLUSTERS:
        return 1.0
    return float(stdtrit(clusters - 1, ndtr(2.0))) / 2.0


def at_least(clustered: FloatArray, other: FloatArray) -> FloatArray:
    """Return a covariance, (p, p), with its standard deviations at least those of another one."""
    size = np.sqrt(np.maximum(np.diagonal(clustered), 0.0))
    least = np.sqrt(np.maximum(np.diagonal(other), 0.0))
    grown = np.divide(least, size, out=np.ones_like(size), where=size > 0.0)
    grown = np.maximum(grown, 1.0)
    return np.asarray(clustered * np.outer(grown, grown))


def changes(information: FloatArray, clusters: Iterable[Cluster]) -> Iterator[FloatArray]:
    """Yield by how much the estimate of all rows differs from that without each cluster, (p,).

    Args:
        information: Shape (p, p). A^T W A of all rows, a prior's included.
        clusters: They are gone through once.
    """
    scale = np.sqrt(np.diagonal(information))
    scales = np.outer(scale, scale)
    normal = information / scales
    for cluster in clusters:
        rest = normal - cluster.gram / scales
        yield np.linalg.lstsq(rest, cluster.score / scale, rcond=1e-12)[0] / scale


def jackknife(information: FloatArray, clusters: Iterable[Cluster]) -> Scatter:
    """Return how the estimate scatters when one cluster after the other is left out.

    Args:
        information: Shape (p, p). A^T W A of all rows, a prior's included.
        clusters: They are gone through once.

    Returns:
        The covariance of the estimate, and the number of clusters.

    Raises:
        EstimationError: Fewer than two clusters.
    """
    spread = np.zeros_like(information)
    count = 0
    for change in changes(information, clusters):
        count += 1
        spread += np.outer(change, change)
    if count < 2:
        raise EstimationError(
            "the intervals need at least two stretches of the recording that differ: record longer",
            code="RID-RECORDING-SHORT",
        )
    return Scatter(np.asarray((count - 1) / count * spread), count)
