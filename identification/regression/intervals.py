"""Intervals that are valid for coloured residuals, because model error is not white noise.

Effects that are not in a model cause residuals that are correlated between rows and joints. Rows
are therefore grouped into clusters, such as a bin of the spectrum or an interval of time. One
cluster after the other is left out, and the covariance follows from the changes of the estimate.
This is the cluster jackknife (MacKinnon, Nielsen and Webb 2023, CV3). A fit adapts to the data, so
its residuals are smaller than the errors. The sandwich estimator therefore underestimates the
errors; the jackknife does not.
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
    """The weighted equations of one cluster, condensed to sums of products of their rows.

    Attributes:
        gram: Shape (p, p). A^T W A of its rows.
        score: Shape (p,). A^T W r of its rows, with the residuals r.
    """

    gram: FloatArray
    score: FloatArray

    @classmethod
    def of(cls, matrix: FloatArray, residual: FloatArray) -> Cluster:
        """Condense the whitened rows (rows, p) of a cluster and their residuals (rows,)."""
        return cls(matrix.T @ matrix, matrix.T @ residual)


@dataclass(frozen=True, eq=False)
class Scatter:
    """Result of the jackknife: each cluster was left out in turn.

    Attributes:
        covariance: Shape (p, p). Covariance of the estimate.
        clusters: Number of clusters.
    """

    covariance: FloatArray
    clusters: int

    @property
    def quoted(self) -> FloatArray:
        """Covariance to report, shape (p, p); two-sigma intervals also hold for few clusters."""
        return self.covariance * widening(self.clusters) ** 2


def widening(clusters: int) -> float:
    """Return the factor by which two-sigma intervals are wider because of few clusters.

    A covariance from G clusters is itself uncertain, so that intervals follow Student's t with G -
    1 degrees of freedom (Cameron and Miller 2015, VI.D). From `FEW_CLUSTERS` on the difference,
    less than 5 %, is neglected.
    """
    if clusters >= FEW_CLUSTERS:
        return 1.0
    return float(stdtrit(clusters - 1, ndtr(2.0))) / 2.0


def covariance_at_least(clustered: FloatArray, other: FloatArray) -> FloatArray:
    """Return `clustered` with its standard deviations raised to at least those of `other`."""
    size = np.sqrt(np.maximum(np.diagonal(clustered), 0.0))
    least = np.sqrt(np.maximum(np.diagonal(other), 0.0))
    grown = np.divide(least, size, out=np.ones_like(size), where=size > 0.0)
    grown = np.maximum(grown, 1.0)
    return np.asarray(clustered * np.outer(grown, grown))


def changes_without_clusters(
    information: FloatArray, clusters: Iterable[Cluster]
) -> Iterator[FloatArray]:
    """Yield for each cluster: estimate from all rows minus estimate without the cluster, (p,).

    Args:
        information: Shape (p, p). A^T W A of all rows, including a prior.
        clusters: The clusters; the iterable is used once.
    """
    scale = np.sqrt(np.diagonal(information))
    scales = np.outer(scale, scale)
    normal = information / scales
    for cluster in clusters:
        rest = normal - cluster.gram / scales
        yield np.linalg.lstsq(rest, cluster.score / scale, rcond=1e-12)[0] / scale


def jackknife(information: FloatArray, clusters: Iterable[Cluster]) -> Scatter:
    """Return the scatter of the estimate when one cluster after the other is left out.

    Args:
        information: Shape (p, p). A^T W A of all rows, including a prior.
        clusters: The clusters; the iterable is used once.

    Returns:
        The covariance of the estimate, and the number of clusters.

    Raises:
        EstimationError: There are fewer than two clusters.
    """
    spread = np.zeros_like(information)
    count = 0
    for change in changes_without_clusters(information, clusters):
        count += 1
        spread += np.outer(change, change)
    if count < 2:
        raise EstimationError(
            "intervals can be computed only from at least two different parts of the recording:"
            " record longer",
            code="RID-RECORDING-SHORT",
        )
    return Scatter(np.asarray((count - 1) / count * spread), count)
