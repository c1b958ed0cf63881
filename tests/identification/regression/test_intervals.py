"""Jackknife intervals from clusters of residuals are compared with intervals from estimates in
which each cluster was left out.
"""

from __future__ import annotations

import numpy as np
import pytest

from config.errors import EstimationError
from identification.regression.intervals import FEW_CLUSTERS, Cluster, jackknife, widening
from tests.builders.raised_codes import raises_code


@pytest.fixture
def clusters_of_rows() -> tuple[np.ndarray, np.ndarray, list[slice]]:
    """Three parameters, and 30 clusters of 8 rows; the rows of a cluster have a common error."""
    random = np.random.default_rng(4)
    matrix = random.normal(size=(240, 3))
    error = np.repeat(random.normal(size=30), 8) + 0.1 * random.normal(size=240)
    return (
        matrix,
        matrix @ np.array([1.0, -2.0, 0.5]) + error,
        [slice(8 * c, 8 * c + 8) for c in range(30)],
    )


def test_the_jackknife_equals_the_removal_of_each_cluster(clusters_of_rows) -> None:
    matrix, rhs, clusters = clusters_of_rows
    values = np.linalg.lstsq(matrix, rhs, rcond=None)[0]
    changes = []
    for rows in clusters:
        keep = np.ones(len(rhs), bool)
        keep[rows] = False
        changes.append(np.linalg.lstsq(matrix[keep], rhs[keep], rcond=None)[0] - values)
    expected = 29.0 / 30.0 * np.transpose(changes) @ np.array(changes)
    residual = rhs - matrix @ values
    found = jackknife(
        matrix.T @ matrix, (Cluster.of(matrix[rows], residual[rows]) for rows in clusters)
    )
    np.testing.assert_allclose(found.covariance, expected, rtol=1e-9)
    assert found.clusters == 30


def test_clusters_are_distinguished_from_independent_rows() -> None:
    """A mean of 400 clusters of ten equal errors is as uncertain as a mean of 400 values."""
    random = np.random.default_rng(2)
    error = np.repeat(random.normal(size=400), 10)
    ones = np.ones((len(error), 1))
    residual = error - error.mean()
    clusters = (Cluster.of(ones[k : k + 10], residual[k : k + 10]) for k in range(0, 4000, 10))
    sigma = np.sqrt(jackknife(ones.T @ ones, clusters).quoted[0, 0])
    assert sigma == pytest.approx(1.0 / np.sqrt(400), rel=0.1)
    assert sigma > 2.5 * np.sqrt(error.var() / len(error))


def test_the_result_does_not_depend_on_the_units_of_parameters(clusters_of_rows) -> None:
    matrix, rhs, clusters = clusters_of_rows
    size = np.array([1e-6, 1.0, 1e6])

    def covariance(columns: np.ndarray) -> np.ndarray:
        values = np.linalg.lstsq(columns, rhs, rcond=None)[0]
        residual = rhs - columns @ values
        parts = (Cluster.of(columns[rows], residual[rows]) for rows in clusters)
        return jackknife(columns.T @ columns, parts).covariance

    np.testing.assert_allclose(
        covariance(matrix * size) * np.outer(size, size), covariance(matrix), rtol=1e-6
    )


@pytest.mark.parametrize("clusters", [3, 5, 12])
def test_two_sigma_cover_the_truth_with_few_clusters(clusters: int) -> None:
    """The coverage of two sigma must be the same with few clusters as with many."""
    random = np.random.default_rng(clusters)
    inside = {"quoted": 0, "covariance": 0}
    ones = np.ones((10, 1))
    for _ in range(1000):
        lumps = random.normal(size=clusters)
        parts = [Cluster.of(ones, np.full(10, lump - lumps.mean())) for lump in lumps]
        found = jackknife(np.array([[10.0 * clusters]]), parts)
        for kind in inside:
            inside[kind] += abs(lumps.mean()) <= 2.0 * np.sqrt(getattr(found, kind)[0, 0])
    assert 935 <= inside["quoted"] <= 975
    assert inside["covariance"] < inside["quoted"] - 10


def test_many_clusters_need_no_widening() -> None:
    assert widening(FEW_CLUSTERS) == 1.0
    assert widening(FEW_CLUSTERS - 1) == pytest.approx(1.04, abs=0.01)


def test_a_single_cluster_is_refused() -> None:
    with raises_code(EstimationError, "RID-RECORDING-SHORT"):
        jackknife(np.eye(1), [Cluster(np.eye(1), np.ones(1))])
