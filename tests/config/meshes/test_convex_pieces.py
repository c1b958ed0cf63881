"""Hulls around meshes of known solids: a hull contains the whole solid, and little more."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls
from scipy.spatial import ConvexHull

from config.arrays import FloatArray, IntArray
from config.meshes.convex_pieces import convex_pieces, hull_volume
from config.meshes.enclosing_hull import EnclosingHull, enclosing_hull
from tests.builders.mesh_files import box, joined

TURN = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
BAR = box((0.0, 0.0, 0.0), (1.0, 0.1, 0.1))
ANGLE = joined(BAR, box((0.0, 0.1, 0.0), (0.1, 1.0, 0.1)))
BRACKET = joined(ANGLE, box((1.0, 0.0, 0.0), (1.1, 1.0, 0.1)))


def corners(shape: tuple[FloatArray, IntArray]) -> FloatArray:
    """Return the triangles (n, 3, 3) of a shape in a general orientation."""
    vertices, faces = shape
    return (vertices @ TURN.T)[faces]


def tube(count: int = 60) -> FloatArray:
    """Return the triangles (n, 3, 3) of the side of a round tube, radius 0.1 m, length 0.5 m."""
    angles = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    rings = np.array(
        [[(0.1 * np.cos(a), 0.1 * np.sin(a), z) for a in angles] for z in (0.0, 0.5)]
    ).reshape(-1, 3)
    k, after = np.arange(count), (np.arange(count) + 1) % count
    faces = np.concatenate(
        [np.stack([k, after, k + count], axis=1), np.stack([after, after + count, k + count], 1)]
    )
    return np.asarray(rings[faces])


def distance_m(hull: EnclosingHull, point: FloatArray) -> float:
    """Return a point's distance from the convex hull of `points_m`, by least squares."""
    weight = 1e4  # of the condition that the coefficients of the hull's points sum to 1
    system = np.vstack([hull.points_m.T, weight * np.ones(len(hull.points_m))])
    return float(nnls(system, np.append(point, weight))[1])


def samples(triangles: FloatArray, count: int) -> FloatArray:
    """Return `count` random points (count, 3) on the triangles."""
    random = np.random.default_rng(1)
    chosen = triangles[random.integers(len(triangles), size=count)]
    return np.einsum("sk,skd->sd", random.dirichlet(np.ones(3), count), chosen)


def test_a_convex_solid_stays_whole() -> None:
    pieces = convex_pieces(corners(BAR), 4)
    assert len(pieces) == 1
    assert hull_volume(pieces[0]) == pytest.approx(0.01)


@pytest.mark.parametrize(
    ("shape", "pieces", "volume", "excess"),
    [(ANGLE, 2, 0.019, 1.25), (BRACKET, 3, 0.029, 1.35)],
)
def test_a_bent_solid_is_cut_into_pieces_of_nearly_its_volume(
    shape, pieces: int, volume: float, excess: float
) -> None:
    whole = corners(shape)
    assert hull_volume(whole.reshape(-1, 3)) > 2.5 * volume
    found = convex_pieces(whole, 4)
    assert len(found) >= pieces
    total = sum(hull_volume(piece) for piece in found)
    assert volume * 0.999 < total < excess * volume
    assert len(convex_pieces(whole, 1)) == 1


@pytest.mark.parametrize("triangles", [corners(ANGLE), corners(BRACKET), tube()])
def test_hulls_contain_the_whole_mesh_within_their_radius(triangles: FloatArray) -> None:
    hulls = [enclosing_hull(piece, 0.004, 48) for piece in convex_pieces(triangles, 4)]
    for point in samples(triangles, 300):
        assert min(distance_m(hull, point) - hull.radius_m for hull in hulls) <= 1e-6
    assert all(hull.radius_m <= 0.0042 for hull in hulls)


def test_a_hull_of_few_points_is_hardly_larger_than_the_points_it_contains() -> None:
    random = np.random.default_rng(5)
    ball = random.normal(size=(3000, 3))
    ball *= 0.1 / np.linalg.norm(ball, axis=1)[:, np.newaxis]
    made = enclosing_hull(ball, 0.002, 48)
    assert len(made.points_m) <= 48
    assert max(distance_m(made, point) for point in ball[::10]) <= made.radius_m
    assert made.radius_m < 0.012  # 48 points on a sphere leave gaps of 35 degrees
    np.testing.assert_allclose(made.points_m, np.round(made.points_m, 4), atol=1e-12)
    assert np.linalg.norm(made.points_m, axis=1).max() <= 0.1 + 1e-4


def test_a_sharp_edge_is_followed_to_its_end() -> None:
    wedge = np.array([(x, y, 0.002 * (1.0 - x)) for x in (0.0, 1.0) for y in (0.0, 0.2)])
    wedge = np.concatenate([wedge, wedge * (1.0, 1.0, -1.0), [(1.3, 0.1, 0.0)]])
    made = enclosing_hull(wedge, 0.004, 48)
    assert max(distance_m(made, point) for point in wedge) <= made.radius_m <= 0.0042


@pytest.mark.parametrize(
    "points",
    [
        [(0.1, 0.2, 0.3)],
        [(0.1, 0.2, 0.3), (0.4, 0.2, 0.3)],
        [(0.0, 0.0, 0.0), (5.0, 0.0, 0.0), (0.0, 5.0, 0.0)],
        [(0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (0.0, 0.5, 0.0), (0.5, 0.5, 0.0), (0.2, 0.2, 0.0)],
    ],
)
def test_a_flat_mesh_becomes_a_thin_hull(points) -> None:
    made = enclosing_hull(np.array(points), 0.004, 48)
    assert ConvexHull(made.points_m).volume > 0.0
    assert max(distance_m(made, np.array(point)) for point in points) <= made.radius_m + 1e-9
    assert np.ptp(made.points_m, axis=0).min() <= 0.0011


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_few_points_or_points_on_a_line_become_a_thin_hull(count: int) -> None:
    points = np.outer(np.linspace(0.0, 0.3, count), TURN[0])
    hull = enclosing_hull(points, 1e-4, 48)
    assert 0.0 < ConvexHull(hull.points_m).volume < 1e-4
