"""`EnclosingHull`: a convex hull of few points, inflated so that it contains many points."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import coal  # pyright: ignore[reportMissingImports]
import numpy as np
from scipy.spatial import ConvexHull

from config.arrays import FloatArray

ROUNDED_M: Final = 1e-4
"""Points are rounded to this length, and the radius is rounded up to it."""
THINNEST_M: Final = 1e-3
"""A set of points that is thinner than this is made thicker by this length [m]."""
_TOUCH_M: Final = 1e-6


@dataclass(frozen=True, eq=False)
class EnclosingHull:
    """All points within `radius_m` of the convex hull of `points_m`, (points, 3)."""

    points_m: FloatArray
    radius_m: float


def enclosing_hull(points_m: FloatArray, tolerance_m: float, most: int) -> EnclosingHull:
    """Return an inflated hull of few points that contains all given points.

    Points are added, always the one that is farthest outside, until none is farther outside than
    the tolerance or there are `most` points. The largest remaining distance becomes the radius. The
    surface of the result is therefore at most `radius_m` (plus 0.1 mm for rounding) away from the
    convex hull of all points.

    Args:
        points_m: Shape (points, 3). At least one point [m].
        tolerance_m: Distance of points outside of the hull that needs no further point [m].
        most: Largest number of points of the hull, at least 8; the radius can then be larger than
            the tolerance.
    """
    points = _thickened(np.unique(points_m, axis=0))
    corners = points[ConvexHull(points).vertices]
    chosen = _extreme_points(corners)
    hull = ConvexHull(corners[chosen], incremental=True)
    while len(chosen) < most:
        outside = _facet_distances(hull, corners)
        farthest = int(np.argmax(outside))
        if outside[farthest] <= 0.5 * tolerance_m or farthest in chosen:
            break
        chosen.append(farthest)
        hull.add_points(corners[farthest : farthest + 1])
    hull.close()
    # At a sharp edge, a point can be far from the hull but close to the planes of its facets.
    while True:
        kept = np.round(corners[chosen] / ROUNDED_M) * ROUNDED_M
        kept = kept[ConvexHull(kept).vertices]
        distances = _distances(kept, corners)
        farthest = int(np.argmax(distances))
        if distances[farthest] <= tolerance_m or farthest in chosen or len(chosen) >= most:
            break
        chosen.append(farthest)
    radius_m = float(distances[farthest])
    return EnclosingHull(kept, math.ceil(radius_m / ROUNDED_M) * ROUNDED_M)


def _thickened(points: FloatArray) -> FloatArray:
    """Return points that span a volume.

    Add corners if they are flat, on a line, or a single point.
    """
    centre = points.mean(axis=0)
    spread = points - centre
    for axis in np.linalg.eigh(spread.T @ spread)[1].T:
        if np.ptp(points @ axis) < THINNEST_M:
            step = 0.5 * THINNEST_M * axis
            points = np.concatenate([points - step, points + step])
    return points


def _extreme_points(corners: FloatArray) -> list[int]:
    """Return the numbers of corners that are extreme along the principal axes; they span a volume.

    If they are flat, the corner farthest from their plane is added.
    """
    axes = np.linalg.svd(corners - corners.mean(axis=0), full_matrices=False)[2]
    along = corners @ axes.T
    chosen = list(dict.fromkeys((*np.argmin(along, axis=0), *np.argmax(along, axis=0))))
    chosen = [int(number) for number in chosen]
    while True:
        centre = corners[chosen].mean(axis=0)
        spread, own = np.linalg.svd(corners[chosen] - centre)[1:]
        if len(chosen) == len(corners) or (len(chosen) > 3 and spread[2] > 1e-6 * spread[0]):
            return chosen
        height = np.abs((corners - centre) @ own[2])
        height[chosen] = -1.0
        chosen.append(int(np.argmax(height)))


def _facet_distances(hull: ConvexHull, corners: FloatArray) -> FloatArray:
    """Return the largest distance of each corner from a facet's plane, positive outside."""
    facets = hull.equations
    return np.asarray((corners @ facets[:, :3].T + facets[:, 3]).max(axis=1))


def _distances(kept: FloatArray, corners: FloatArray) -> FloatArray:
    """Return each corner's distance from the convex hull of the kept points, (corners,) [m]."""
    rows = np.flatnonzero(_facet_distances(ConvexHull(kept), corners) > 0.0)
    centre = kept.mean(axis=0)
    listed = coal.StdVec_Vec3s()
    for point in kept:
        listed.append(point - centre)
    shape = coal.Convex.convexHull(listed, True, "Qt")
    ball = coal.Sphere(ROUNDED_M)
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    distances = np.zeros(len(corners))
    for row in rows:
        result.clear()
        place = coal.Transform3s(np.eye(3), corners[row] - centre)
        gap = coal.distance(shape, coal.Transform3s.Identity(), ball, place, request, result)
        distances[row] = max(0.0, gap + ROUNDED_M) + _TOUCH_M
    return distances
