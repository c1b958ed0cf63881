"""`Mesh`: a surface made of triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from config.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles in space; they need not be closed, connected or consistently oriented.

    Attributes:
        vertices_m: Shape (vertices, 3). Corners of the triangles [m].
        triangles: Shape (triangles, 3). Numbers of each triangle's three vertices.
        is_hull: True if these are not the file's triangles but the convex hull of its vertices.
    """

    vertices_m: FloatArray
    triangles: IntArray
    is_hull: bool = False

    @property
    def corners_m(self) -> FloatArray:
        """Corners of each triangle, (triangles, 3, 3) [m]."""
        return np.asarray(self.vertices_m[self.triangles])

    @property
    def size_m(self) -> float:
        """Longest side of the box along the axes that encloses the mesh [m]."""
        return float(np.ptp(self.vertices_m, axis=0).max())

    def scaled(self, scale: tuple[float, float, float]) -> Mesh:
        """Return the mesh with each axis multiplied by a factor, which is negative for a mirror.

        A mirrored mesh keeps its outward side: the order of each triangle's corners is reversed.
        """
        mirrored = np.prod(np.sign(scale)) < 0.0
        order = [0, 2, 1] if mirrored else [0, 1, 2]
        return Mesh(self.vertices_m * np.array(scale), self.triangles[:, order], self.is_hull)

    def placed(self, pose: FloatArray) -> Mesh:
        """Return the mesh in another frame; `pose`, (4, 4), is the pose of its frame there."""
        vertices_m = self.vertices_m @ pose[:3, :3].T + pose[:3, 3]
        return Mesh(vertices_m, self.triangles, self.is_hull)
