"""Division of a mesh into few pieces whose convex hulls contain it.

A piece is cut by the plane, of those tried, that saves the most volume: the volume of its hull
minus the volumes of the hulls of its two parts. The triangles are cut exactly. A closed mesh and
the solid inside it are therefore contained in the hulls of the pieces.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from config.arrays import FloatArray

LEAST_SAVING: Final = 0.08
"""A cut must reduce the volume of the hulls by at least this fraction of the volume of the whole
mesh's hull."""
CUTS: Final = (0.15, 0.3, 0.5, 0.7, 0.85)
"""Positions of the cutting planes that are tried, as fractions of the piece's length in each
direction."""
SHIFTS: Final = (-0.09, -0.06, -0.03, 0.0, 0.03, 0.06, 0.09)
"""Shifts of the best of these planes that are tried next, as fractions of the same length."""
_FINE: Final = 20
"""Number of samples along the longest side of a piece, to estimate volumes."""
_MOST_STEPS: Final = 40


@dataclass(frozen=True, eq=False)
class _Plane:
    """Points x with normal . x = offset."""

    normal: FloatArray
    offset_m: float


@dataclass(frozen=True, eq=False)
class _Piece:
    """Some triangles of a mesh, (triangles, 3, 3) [m]."""

    corners_m: FloatArray

    @cached_property
    def points_m(self) -> FloatArray:
        """The corners, (points, 3) [m]."""
        return self.corners_m.reshape(-1, 3)

    @cached_property
    def volume_m3(self) -> float:
        """Volume of the convex hull [m³]."""
        return hull_volume(self.points_m)

    @cached_property
    def best_cut(self) -> tuple[float, tuple[_Piece, ...]]:
        """The volume that the best plane saves [m³], and the two parts."""
        cloud, step = _surface_samples(self.corners_m)
        axes = np.linalg.eigh(np.cov(cloud.T))[1].T if len(cloud) > 3 else np.zeros((0, 3))
        axes = np.concatenate([np.eye(3), axes])

        def volume_m3(axis: FloatArray, share: float) -> float:
            """Return the volume of both hulls; both parts keep the samples close to the plane."""
            along = cloud @ axis
            offset = _between(along, share)
            below, above = along <= offset + 0.5 * step, along >= offset - 0.5 * step
            return hull_volume(cloud[below]) + hull_volume(cloud[above])

        tried = [
            (volume_m3(axis, share), k, share) for k, axis in enumerate(axes) for share in CUTS
        ]
        _, k, place = min(tried)
        tried = [(volume_m3(axes[k], place + shift), k, place + shift) for shift in SHIFTS]
        best = _Plane(axes[k], _between(cloud @ axes[k], min(tried)[2]))
        parts = self.cut(best)
        return self.volume_m3 - sum(part.volume_m3 for part in parts), parts

    def cut(self, plane: _Plane) -> tuple[_Piece, _Piece]:
        """Return the parts below and above a plane."""
        height = self.corners_m @ plane.normal - plane.offset_m
        return _Piece(_clipped(self.corners_m, -height)), _Piece(_clipped(self.corners_m, height))


def convex_pieces(corners_m: FloatArray, most: int) -> list[FloatArray]:
    """Return point sets whose convex hulls together contain a mesh.

    Args:
        corners_m: Shape (triangles, 3, 3). Corners of the triangles [m].
        most: The largest number of pieces.

    Returns:
        The points of each piece, (points, 3) [m].
    """
    pieces = [_Piece(corners_m)]
    least = LEAST_SAVING * pieces[0].volume_m3
    while len(pieces) < most:
        piece = max(pieces, key=lambda each: each.best_cut[0])
        saved, parts = piece.best_cut
        if saved <= least:
            break
        pieces = [each for each in pieces if each is not piece]
        pieces += parts
    return [piece.points_m for piece in pieces]


def hull_volume(points_m: FloatArray) -> float:
    """Return the volume of the convex hull of points, (points, 3) [m³]; 0 if they are flat."""
    if len(points_m) < 4:
        return 0.0
    try:
        return float(ConvexHull(points_m).volume)
    except QhullError:
        return 0.0


def _between(along: FloatArray, share: float) -> float:
    """Return the value at a fraction of the range of an array."""
    low, high = float(along.min()), float(along.max())
    return low + share * (high - low)


def _clipped(corners: FloatArray, height: FloatArray) -> FloatArray:
    """Return the parts of triangles at which `height`, (triangles, 3), is not negative.

    A triangle with one corner above the plane becomes a smaller triangle; one with two becomes two.
    """
    above = height >= 0.0
    count = above.sum(axis=1)
    kept = [corners[count == 3]]
    for number in (1, 2):
        rows = np.flatnonzero(count == number)
        # Reorder the corners of each triangle so that the first corner is alone on its side of the
        # plane.
        single = above[rows] if number == 1 else ~above[rows]
        turned = (np.argmax(single, axis=1)[:, np.newaxis] + np.arange(3)) % 3
        a, b, c = (corners[rows, turned[:, k]] for k in range(3))
        ha, hb, hc = (height[rows, turned[:, k]] for k in range(3))
        ab = a + (ha / (ha - hb))[:, np.newaxis] * (b - a)
        ac = a + (ha / (ha - hc))[:, np.newaxis] * (c - a)
        if number == 1:
            kept.append(np.stack([a, ab, ac], axis=1))
        else:
            kept += [np.stack([ab, b, c], axis=1), np.stack([ab, c, ac], axis=1)]
    return np.concatenate(kept)


def _surface_samples(corners: FloatArray) -> tuple[FloatArray, float]:
    """Return points on triangles, (points, 3), and the largest distance of neighbouring points [m].

    All corners are among them, but rounded to a fine grid, so that equal points can be removed.
    """
    points = corners.reshape(-1, 3)
    low = points.min(axis=0)
    step = max(float(np.ptp(points, axis=0).max()) / _FINE, 1e-9)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    steps = np.clip(np.ceil(longest / step), 1, _MOST_STEPS).astype(np.int64)
    samples = []
    for count in np.unique(steps):
        i, j = (part.ravel() for part in np.indices((count + 1, count + 1)))
        inside = i + j <= count
        weights = np.stack([i, j, count - i - j], axis=1)[inside] / count
        samples.append((weights @ corners[steps == count]).reshape(-1, 3))
    cells = np.round((np.concatenate(samples) - low) / (0.25 * step)).astype(np.int64)
    first = np.unique((cells[:, 0] << 40) + (cells[:, 1] << 20) + cells[:, 2], return_index=True)[1]
    return cells[first] * (0.25 * step) + low, step
