"""`simplify_links`: the meshes of a robot's links with fewer triangles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import fast_simplification  # pyright: ignore[reportMissingImports]
import numpy as np

from config.meshes.mesh import Mesh
from rid_daq.robot_view.solids import coarse_hull_mesh

_LEAST: Final = 60
"""Number of triangles that every link may keep."""

_MARGIN: Final = 0.05
"""Largest change of a link's size, relative to its largest dimension."""

_SAME_M: Final = 1e-6
"""Vertices that are closer become one."""


def simplify_links(links: Sequence[Mesh], most_triangles: int) -> list[Mesh]:
    """Return meshes with at most `most_triangles` triangles together.

    Each link keeps a share in proportion to its triangles. Simplification can remove whole shells
    of a link that consists of very many. If its size changes by more than 5 %, the link becomes
    its convex hull.

    Args:
        links: Meshes of the links.
        most_triangles: At least 100 per link.
    """
    welded = [_weld(mesh) for mesh in links]
    total = sum(len(mesh.triangles) for mesh in welded)
    if total <= most_triangles:
        return welded
    shared = most_triangles - _LEAST * len(links)
    return [_simplify(mesh, _LEAST + int(shared * len(mesh.triangles) / total)) for mesh in welded]


def _simplify(mesh: Mesh, most: int) -> Mesh:
    if len(mesh.triangles) <= most:
        return mesh
    vertices, triangles = fast_simplification.simplify(
        mesh.vertices_m.astype(np.float32), mesh.triangles.astype(np.int32), target_count=most
    )
    simple = Mesh(np.asarray(vertices, dtype=np.float64), np.asarray(triangles, dtype=np.int64))
    if len(triangles) > most or not _keeps_size(simple, mesh):
        return coarse_hull_mesh(mesh.vertices_m, most // 2)
    return simple


def _keeps_size(simple: Mesh, mesh: Mesh) -> bool:
    """Return True if both meshes fill the same box along the axes, except for a small margin."""
    if not len(simple.triangles):
        return False
    corners = simple.corners_m.reshape(-1, 3)
    difference = [
        corners.min(axis=0) - mesh.vertices_m.min(axis=0),
        corners.max(axis=0) - mesh.vertices_m.max(axis=0),
    ]
    return bool(np.abs(difference).max() <= _MARGIN * mesh.size_m)


def _weld(mesh: Mesh) -> Mesh:
    """Return the mesh with one vertex per place, without triangles that have no area."""
    places = np.round(mesh.vertices_m / _SAME_M).astype(np.int64)
    _, first, number = np.unique(places, axis=0, return_index=True, return_inverse=True)
    triangles = number.reshape(-1)[mesh.triangles]
    whole = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    return Mesh(mesh.vertices_m[first], triangles[whole])
