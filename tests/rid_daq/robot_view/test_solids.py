"""Coarse hulls of meshes: few triangles, nearly the whole volume, little memory."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from rid_daq.robot_view.solids import coarse_hull_mesh


def ball(count: int) -> np.ndarray:
    """Return random points on a sphere of radius 1 m."""
    points = np.random.default_rng(1).normal(size=(count, 3))
    return np.asarray(points / np.linalg.norm(points, axis=1)[:, np.newaxis])


def test_a_mesh_of_many_points_needs_little_memory() -> None:
    points = ball(20_000)
    tracemalloc.start()
    mesh = coarse_hull_mesh(points, 2_000)
    peak_bytes = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(mesh.triangles) < 4_000
    assert ConvexHull(mesh.vertices_m).volume == pytest.approx(4.0 * np.pi / 3.0, rel=0.01)
    assert peak_bytes < 100e6  # the products of all points and directions would take 320 MB


def test_a_hull_of_few_points_keeps_all_of_them() -> None:
    points = ball(300)
    mesh = coarse_hull_mesh(np.concatenate([points, 0.5 * points]), 400)
    assert len(mesh.vertices_m) == 300
