"""Meshes of simple solids: solids of revolution, tubes, boxes and convex hulls."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from config.arrays import FloatArray, IntArray
from config.meshes.mesh import Mesh

DIRECTIONS_AT_ONCE: Final = 256
"""Number of directions for which the farthest points of a mesh are computed at once.

The memory grows with this number times the number of points.
"""


def join_meshes(parts: Iterable[Mesh]) -> Mesh:
    """Return one mesh with all triangles of several meshes."""
    points, triangles, count = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], 0
    for part in parts:
        points.append(part.vertices_m)
        triangles.append(part.triangles + count)
        count += len(part.vertices_m)
    return Mesh(np.concatenate(points), np.concatenate(triangles))


def area_vectors(mesh: Mesh) -> FloatArray:
    """Return the normal of each triangle, (triangles, 3), twice as long as its area [m^2]."""
    first, second, third = mesh.corners_m.transpose(1, 0, 2)
    return np.asarray(np.cross(second - first, third - first))


def revolve(
    start: npt.ArrayLike,
    axis: npt.ArrayLike,
    profile: Sequence[tuple[float, float]],
    segments: int,
) -> Mesh:
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
    ends = np.array([profile[0][0] * z, profile[-1][0] * z])
    first = np.asarray(start)
    return _skin(first + np.concatenate(rings), first + ends, segments)


def capsule_mesh(start: npt.ArrayLike, end: npt.ArrayLike, radius: float, segments: int) -> Mesh:
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


def cylinder_mesh(start: npt.ArrayLike, end: npt.ArrayLike, radius: float, segments: int) -> Mesh:
    """Return a cylinder; its ends are different points."""
    along = np.subtract(end, start)
    length = float(np.linalg.norm(along))
    profile = [(0.0, 0.0), (0.0, radius), (length, radius), (length, 0.0)]
    return revolve(start, along / length, profile, segments)


def arrow_mesh(start: npt.ArrayLike, end: npt.ArrayLike, radius: float) -> Mesh:
    """Return an arrow whose shaft has a radius [m]."""
    along = np.subtract(end, start)
    length = float(np.linalg.norm(along))
    neck = max(0.0, length - 7.0 * radius)
    profile = [(0.0, 0.0), (0.0, radius), (neck, radius), (neck, 2.6 * radius), (length, 0.0)]
    return revolve(start, along / length, profile, 16)


def tube_mesh(path: FloatArray, normal: FloatArray, radius: float) -> Mesh:
    """Return a tube along a path in a plane, with flat ends.

    Args:
        path: Shape (places, 3).
        normal: Shape (3,). Unit normal of the path's plane.
        radius: Radius of the tube [m].
    """
    along = np.gradient(path, axis=0)
    side = np.cross(along / np.linalg.norm(along, axis=1, keepdims=True), normal)
    angles = 2.0 * np.pi * np.arange(8) / 8
    ring = np.cos(angles)[:, np.newaxis, np.newaxis] * side
    ring = ring + np.sin(angles)[:, np.newaxis, np.newaxis] * normal
    points = (path + radius * ring).transpose(1, 0, 2).reshape(-1, 3)
    return _skin(points, np.array([path[0], path[-1]]), 8)


def box_mesh(least: npt.ArrayLike, most: npt.ArrayLike) -> Mesh:
    """Return a box along the axes between two opposite corners."""
    corners = np.array(np.meshgrid(*np.transpose([least, most]))).reshape(3, -1).T
    return hull_mesh(corners)


def hull_mesh(points: npt.ArrayLike) -> Mesh:
    """Return the convex hull of points, (points, 3), that span a volume."""
    from scipy.spatial import ConvexHull  # imported late: it takes 30 MB of memory

    hull = ConvexHull(np.asarray(points, dtype=np.float64))
    used, triangles = np.unique(hull.simplices, return_inverse=True)
    mesh = Mesh(hull.points[used], triangles.reshape(-1, 3))
    inwards = np.einsum("ij,ij->i", area_vectors(mesh), hull.equations[:, :3]) < 0.0
    flipped = np.where(inwards[:, np.newaxis], mesh.triangles[:, ::-1], mesh.triangles)
    return Mesh(mesh.vertices_m, flipped)


def coarse_hull_mesh(points: FloatArray, most_points: int) -> Mesh:
    """Return the hull of at most `most_points` of the points, which lie farthest out.

    Args:
        points: Shape (points, 3). They span a volume.
        most_points: At least 6. The hull has fewer than twice as many triangles.
    """
    from scipy.spatial import ConvexHull  # imported late: it takes 30 MB of memory

    points = points[ConvexHull(points).vertices]
    if len(points) <= most_points:
        return hull_mesh(points)
    kept: IntArray = np.unique([*points.argmin(axis=0), *points.argmax(axis=0)])
    k = np.arange(most_points - 6) + 0.5
    height, angle = 1.0 - 2.0 * k / max(1, len(k)), np.pi * (1.0 + 5.0**0.5) * k
    level = np.sqrt(1.0 - height**2)
    directions = np.column_stack([level * np.cos(angle), level * np.sin(angle), height])
    blocks = np.array_split(directions, math.ceil(len(directions) / DIRECTIONS_AT_ONCE))
    farthest = np.concatenate([(points @ block.T).argmax(axis=0) for block in blocks])
    return hull_mesh(points[np.unique([*kept, *farthest])])


def _skin(rings: FloatArray, ends: FloatArray, segments: int) -> Mesh:
    """Return the skin of successive rings, closed by triangles to a point at each end.

    Args:
        rings: Shape (rings * segments, 3). Points ring by ring; seen along the rings' order, each
            ring runs clockwise.
        ends: Shape (2, 3). Points that close the first and the last ring.
        segments: Number of points per ring.
    """
    this = np.arange(segments)
    following = np.roll(this, -1)
    first, last = np.full(segments, len(rings)), np.full(segments, len(rings) + 1)
    triangles = [np.column_stack([first, following, this])]
    for low in range(0, len(rings) - segments, segments):
        high = low + segments
        triangles.append(np.column_stack([this + low, following + low, following + high]))
        triangles.append(np.column_stack([this + low, following + high, this + high]))
    top = len(rings) - segments
    triangles.append(np.column_stack([this + top, following + top, last]))
    return Mesh(np.concatenate([rings, ends]), np.concatenate(triangles))


def _normals_to(z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors that form a right-handed frame with a unit vector."""
    x = np.cross(np.eye(3)[np.abs(z).argmin()], z)
    x /= np.linalg.norm(x)
    return x, np.cross(z, x)
