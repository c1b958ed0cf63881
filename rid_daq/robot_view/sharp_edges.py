"""`split_at_edges`: gives a mesh separate points on both sides of each sharp edge."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from config.arrays import FloatArray, IntArray
from config.meshes.mesh import Mesh
from rid_daq.robot_view.solids import area_vectors

CREASE_RAD: Final = np.radians(35.0)
"""An edge between two triangles is drawn sharp if their normals differ by more [rad]."""

_SMALLEST: Final = 1e-300


def split_at_edges(mesh: Mesh) -> tuple[Mesh, FloatArray]:
    """Return a mesh with separate points on both sides of sharp edges, and their normals.

    Triangles that share an edge without a crease share its two points; other triangles do not,
    even if the points have the same place. A viewer that averages the normals of the triangles
    at each point therefore draws round surfaces smooth and edges sharp.

    Returns:
        The mesh, and the unit normals of its points, (points, 3).
    """
    areas = area_vectors(mesh)
    if not len(areas):
        return Mesh(np.zeros((0, 3)), mesh.triangles), np.zeros((0, 3))
    count, label = _smooth_corners(mesh.triangles, _units(areas))
    points, sums = np.zeros((count, 3)), np.zeros((count, 3))
    points[label] = mesh.vertices_m[mesh.triangles.ravel()]
    np.add.at(sums, label, np.repeat(areas, 3, axis=0))
    return Mesh(points, label.reshape(-1, 3)), _units(sums)


def _units(vectors: FloatArray) -> FloatArray:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.maximum(lengths, _SMALLEST))


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
