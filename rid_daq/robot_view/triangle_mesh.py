"""`TriangleMesh`: triangles of a surface; solids of revolution and convex hulls."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull

from config.arrays import FloatArray, IntArray, freeze
from config.errors import EstimationError

CREASE_RAD: Final = np.radians(35.0)
"""An edge between two triangles is drawn sharp if their normals differ by more [rad]."""


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Triangles of a surface; seen from outside, their corners run counter-clockwise.

    Attributes:
        points: Shape (points, 3). Corners [m].
        triangles: Shape (triangles, 3). Numbers of the corners of each triangle.
    """

    points: FloatArray
    triangles: IntArray

    def __post_init__(self) -> None:
        freeze(self, EstimationError, (None, 3), "points")
        freeze(self, EstimationError, (None, 3), "triangles", dtype=np.int64)
        if self.triangles.size and not (
            self.triangles.min() >= 0 and self.triangles.max() < len(self.points)
        ):
            raise EstimationError(
                f"a triangle names point {self.triangles.max()} of {len(self.points)} points",
                code="RID-API-ARGUMENT",
            )

    @classmethod
    def empty(cls) -> TriangleMesh:
        """Return a mesh without triangles."""
        return cls(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))

    @classmethod
    def of_parts(cls, parts: Iterable[TriangleMesh]) -> TriangleMesh:
        """Return one mesh with all triangles of several meshes."""
        points, triangles, count = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], 0
        for part in parts:
            points.append(part.points)
            triangles.append(part.triangles + count)
            count += len(part.points)
        return cls(np.concatenate(points), np.concatenate(triangles))

    def moved(self, pose: FloatArray) -> TriangleMesh:
        """Return the mesh in the parent frame of its frame, whose pose is (4, 4)."""
        return TriangleMesh(self.points @ pose[:3, :3].T + pose[:3, 3], self.triangles)

    @property
    def areas(self) -> FloatArray:
        """Normals of the triangles, (triangles, 3); their length is twice the area [m^2]."""
        first, second, third = (self.points[self.triangles[:, corner]] for corner in range(3))
        return np.cross(second - first, third - first)

    def with_sharp_edges(self) -> tuple[TriangleMesh, FloatArray]:
        """Return the mesh with separate points on both sides of sharp edges, and their normals.

        Triangles that share an edge without a crease share its two points; other triangles do not,
        even if the points have the same place. A viewer that averages the normals of the triangles
        at each point therefore draws round surfaces smooth and edges sharp.

        Returns:
            The mesh, and the unit normals of its points, (points, 3).
        """
        areas = self.areas
        if not len(areas):
            return TriangleMesh.empty(), np.zeros((0, 3))
        normals = areas / np.maximum(np.linalg.norm(areas, axis=1, keepdims=True), 1e-300)
        count, label = _smooth_corners(self.triangles, normals)
        points, sums = np.zeros((count, 3)), np.zeros((count, 3))
        points[label] = self.points[self.triangles.ravel()]
        np.add.at(sums, label, np.repeat(areas, 3, axis=0))
        sums /= np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-300)
        return TriangleMesh(points, label.reshape(-1, 3)), sums


def revolve(
    start: npt.ArrayLike,
    axis: npt.ArrayLike,
    profile: Sequence[tuple[float, float]],
    segments: int,
) -> TriangleMesh:
    """Return a closed solid of revolution.

    Args:
        start: Shape (3,). Origin of the profile, on the axis.
        axis: Shape (3,). Unit vector.
        profile: Position along the axis and radius of each ring [m], along the axis. The first and
            the last radius are zero.
        segments: Number of segments around the axis.
    """
    z = np.asarray(axis, dtype=np.float64)
    x, y = _normals_to(z)
    angles = 2.0 * np.pi * np.arange(segments) / segments
    around = np.cos(angles)[:, np.newaxis] * x + np.sin(angles)[:, np.newaxis] * y
    rings = [at * z + radius * around for at, radius in profile[1:-1]]
    ends = [profile[0][0] * z, profile[-1][0] * z]
    points = np.asarray(start) + np.concatenate([*rings, ends])
    this = np.arange(segments)
    following = np.roll(this, -1)
    top, bottom = len(points) - 1, len(points) - 2
    triangles = [np.column_stack([np.full(segments, bottom), following, this])]
    for ring in range(len(rings) - 1):
        low, high = ring * segments, (ring + 1) * segments
        triangles.append(np.column_stack([this + low, following + low, following + high]))
        triangles.append(np.column_stack([this + low, following + high, this + high]))
    last = (len(rings) - 1) * segments
    triangles.append(np.column_stack([this + last, following + last, np.full(segments, top)]))
    return TriangleMesh(points, np.concatenate(triangles))


def capsule_mesh(
    start: npt.ArrayLike, end: npt.ArrayLike, radius: float, segments: int
) -> TriangleMesh:
    """Return a capsule; a sphere if both ends of its axis are the same point."""
    first, along = np.asarray(start, dtype=np.float64), np.subtract(end, start)
    length = float(np.linalg.norm(along))
    axis = along / length if length > 1e-9 else np.array([0.0, 0.0, 1.0])
    steps = max(2, segments // 4)
    lifts = [(np.sin(turn), np.cos(turn)) for turn in 0.5 * np.pi * np.arange(steps) / steps]
    profile = [(-radius, 0.0)]
    profile += [(-radius * sine, radius * cosine) for sine, cosine in reversed(lifts)]
    profile += [(length + radius * sine, radius * cosine) for sine, cosine in lifts]
    profile += [(length + radius, 0.0)]
    return revolve(first, axis, profile, segments)


def cylinder_mesh(
    start: npt.ArrayLike, end: npt.ArrayLike, radius: float, segments: int
) -> TriangleMesh:
    """Return a cylinder; its ends are different points."""
    along = np.subtract(end, start)
    length = float(np.linalg.norm(along))
    profile = [(0.0, 0.0), (0.0, radius), (length, radius), (length, 0.0)]
    return revolve(start, along / length, profile, segments)


def arrow_mesh(start: npt.ArrayLike, end: npt.ArrayLike, radius: float) -> TriangleMesh:
    """Return an arrow whose shaft has a radius [m]."""
    along = np.subtract(end, start)
    length = float(np.linalg.norm(along))
    neck = max(0.0, length - 7.0 * radius)
    profile = [(0.0, 0.0), (0.0, radius), (neck, radius), (neck, 2.6 * radius), (length, 0.0)]
    return revolve(start, along / length, profile, 16)


def box_mesh(least: npt.ArrayLike, most: npt.ArrayLike) -> TriangleMesh:
    """Return a box along the axes between two opposite corners."""
    corners = np.array(np.meshgrid(*np.transpose([least, most]))).reshape(3, -1).T
    return hull_mesh(corners)


def hull_mesh(points: npt.ArrayLike) -> TriangleMesh:
    """Return the convex hull of points, (points, 3), that span a volume."""
    hull = ConvexHull(np.asarray(points, dtype=np.float64))
    used, triangles = np.unique(hull.simplices, return_inverse=True)
    mesh = TriangleMesh(hull.points[used], triangles.reshape(-1, 3))
    inwards = np.einsum("ij,ij->i", mesh.areas, hull.equations[:, :3]) < 0.0
    flipped = np.where(inwards[:, np.newaxis], mesh.triangles[:, ::-1], mesh.triangles)
    return TriangleMesh(mesh.points, flipped)


def coarse_hull_mesh(points: FloatArray, most_points: int) -> TriangleMesh:
    """Return the hull of at most `most_points` of the points, which lie farthest out.

    Args:
        points: Shape (points, 3). They span a volume.
        most_points: At least 6. The hull has fewer than twice as many triangles.
    """
    kept: IntArray = np.unique([*points.argmin(axis=0), *points.argmax(axis=0)])
    k = np.arange(most_points - 6) + 0.5
    height, angle = 1.0 - 2.0 * k / max(1, len(k)), np.pi * (1.0 + 5.0**0.5) * k
    level = np.sqrt(1.0 - height**2)
    directions = np.column_stack([level * np.cos(angle), level * np.sin(angle), height])
    farthest = (points @ directions.T).argmax(axis=0)
    return hull_mesh(points[np.unique([*kept, *farthest])])


def _normals_to(z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors that form a right-handed frame with a unit vector."""
    x = np.cross(np.eye(3)[np.abs(z).argmin()], z)
    x /= np.linalg.norm(x)
    return x, np.cross(z, x)


def _smooth_corners(triangles: IntArray, normals: FloatArray) -> tuple[int, IntArray]:
    """Return the number of points after the split, and the point of each corner."""
    tails = np.arange(triangles.size).reshape(-1, 3)
    heads = np.roll(tails, -1, axis=1)
    flat = triangles.ravel()
    tail, head = tails.ravel(), heads.ravel()
    runs_up = flat[tail] < flat[head]
    low, high = np.where(runs_up, tail, head), np.where(runs_up, head, tail)
    edge = flat[low] * (int(flat.max()) + 1) + flat[high]
    order = np.argsort(edge, kind="stable")
    pairs = np.flatnonzero(np.diff(edge[order]) == 0)
    one, other = order[pairs], order[pairs + 1]
    smooth = np.einsum("ij,ij->i", normals[one // 3], normals[other // 3]) > np.cos(CREASE_RAD)
    one, other = one[smooth], other[smooth]
    rows, columns = np.concatenate([low[one], high[one]]), np.concatenate([low[other], high[other]])
    joined = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(flat.size, flat.size))
    count, label = connected_components(joined, directed=False)
    return int(count), label.astype(np.int64)
