"""`Canvas`: draws triangles with a depth buffer, and outlines of the parts."""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from config.arrays import FloatArray, IntArray
from config.meshes.mesh import Mesh

SAMPLES: Final = 2
"""Samples per pixel in each direction."""

BACKGROUND: Final = 255.0
OUTLINE: Final = (27.0, 37.0, 48.0)

_STEP: Final = 0.02
"""A step of the depth by more than this fraction of the picture's width gets an outline."""

_FRONT: Final = 1e6
"""Added to the depth of parts that are visible through other parts [px]."""

_NOTHING: Final = -1


class Canvas:
    """Picture with a depth buffer.

    Points have the picture's coordinates: x to the right and y down [px], z towards the viewer.

    Args:
        width, height: Size of the picture [px].
    """

    def __init__(self, width: int, height: int) -> None:
        fine = height * SAMPLES, width * SAMPLES
        self._picture = np.empty((height, width, 3), dtype=np.uint8)
        self._image = np.full((*fine, 3), BACKGROUND, dtype=np.float32)
        self._depth = np.full(fine, -np.inf)
        self._owner = np.full(fine, _NOTHING, dtype=np.int32)
        self._parts = 0

    def draw(self, mesh: Mesh, normals: FloatArray, colour: FloatArray, *, in_front: bool) -> None:
        """Draw one part.

        Args:
            mesh: Triangles in the picture's coordinates.
            normals: Shape (points, 3). Unit normals in the view: right, up, towards the viewer.
            colour: Shape (3,). Red, green and blue, 0 to 255.
            in_front: True to show the part through all parts that are not in front.
        """
        points = mesh.vertices_m * SAMPLES
        points[:, 2] += _FRONT if in_front else 0.0
        _fill(
            points,
            normals,
            colour,
            mesh.triangles,
            self._parts,
            self._image,
            self._depth,
            self._owner,
        )
        self._parts += 1

    def pixels(self) -> NDArray[np.uint8]:
        """Return the picture with outlines, (height, width, 3)."""
        step = _STEP * self._depth.shape[1]
        _resolve(self._image, self._depth, self._owner, step, self._picture)
        return self._picture


@njit(cache=True, nogil=True)  # without `fastmath`, so that all processors give the same picture
def _fill(
    points: FloatArray,
    normals: FloatArray,
    colour: FloatArray,
    triangles: IntArray,
    part: int,
    image: NDArray[np.float32],
    depth: FloatArray,
    owner: NDArray[np.int32],
) -> None:
    """Fill triangles; a pixel is changed if the triangle is nearer than all before it.

    Args:
        points: Shape (points, 3). x, y [samples] and depth, larger towards the viewer.
        normals: Shape (points, 3).
        colour: Shape (3,).
        triangles: Shape (triangles, 3).
        part: Number of the part.
        image: Shape (height, width, 3); changed.
        depth, owner: Shape (height, width). Depth, and number of the visible part; changed.
    """
    height, width = depth.shape
    for t in range(len(triangles)):
        i, j, k = triangles[t]
        ax, ay = points[i, 0], points[i, 1]
        bx, by = points[j, 0], points[j, 1]
        cx, cy = points[k, 0], points[k, 1]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if abs(area) < 1e-9:
            continue
        top, bottom = max(0.0, min(ay, by, cy)), min(height - 1.0, max(ay, by, cy))
        left, right = max(0.0, min(ax, bx, cx)), min(width - 1.0, max(ax, bx, cx))
        if bottom < top or right < left:
            continue
        for y in range(int(top), int(bottom) + 1):
            for x in range(int(left), int(right) + 1):
                px, py = x + 0.5, y + 0.5
                u = ((bx - px) * (cy - py) - (by - py) * (cx - px)) / area
                v = ((cx - px) * (ay - py) - (cy - py) * (ax - px)) / area
                w = 1.0 - u - v
                if u < 0.0 or v < 0.0 or w < 0.0:
                    continue
                z = u * points[i, 2] + v * points[j, 2] + w * points[k, 2]
                if z <= depth[y, x]:
                    continue
                depth[y, x] = z
                owner[y, x] = part
                right_n = u * normals[i, 0] + v * normals[j, 0] + w * normals[k, 0]
                up_n = u * normals[i, 1] + v * normals[j, 1] + w * normals[k, 1]
                near_n = abs(u * normals[i, 2] + v * normals[j, 2] + w * normals[k, 2])
                light = 0.58 + 0.28 * near_n + 0.16 * up_n - 0.07 * right_n
                for c in range(3):
                    image[y, x, c] = min(255.0, max(0.0, colour[c] * light))


@njit(cache=True, nogil=True)
def _resolve(
    image: NDArray[np.float32],
    depth: FloatArray,
    owner: NDArray[np.int32],
    step: float,
    picture: NDArray[np.uint8],
) -> None:
    """Average the samples of each pixel; samples at edges of parts have the outline's colour.

    Args:
        image, depth, owner: As `_fill` left them.
        step: Smallest step of the depth that is an edge [samples].
        picture: Shape (height, width, 3); overwritten.
    """
    height, width, _ = picture.shape
    for row in range(height):
        for column in range(width):
            red, green, blue = 0.0, 0.0, 0.0
            for sample in range(SAMPLES * SAMPLES):
                y = row * SAMPLES + sample // SAMPLES
                x = column * SAMPLES + sample % SAMPLES
                above, before = max(y - 1, 0), max(x - 1, 0)
                here = owner[y, x]
                edge = here != owner[above, x] or here != owner[y, before]
                if here != _NOTHING and not edge:
                    edge = abs(depth[y, x] - depth[above, x]) > step
                    edge = edge or abs(depth[y, x] - depth[y, before]) > step
                red += OUTLINE[0] if edge else image[y, x, 0]
                green += OUTLINE[1] if edge else image[y, x, 1]
                blue += OUTLINE[2] if edge else image[y, x, 2]
            samples = SAMPLES * SAMPLES
            picture[row, column, 0] = int(red / samples + 0.5)
            picture[row, column, 1] = int(green / samples + 0.5)
            picture[row, column, 2] = int(blue / samples + 0.5)
