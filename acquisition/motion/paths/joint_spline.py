"""The smooth curve of the joints through poses, by its length."""

from __future__ import annotations

from scipy.interpolate import CubicSpline

from config.arrays import FloatArray


def joint_spline(knots: FloatArray, points: FloatArray) -> CubicSpline:
    """Return the cubic spline through poses; the straight way between two.

    Args:
        knots: Shape (m,). The length at each pose, increasing.
        points: Shape (m, n). The poses, two at least.
    """
    if len(points) > 2:
        return CubicSpline(knots, points)
    slope = (points[1] - points[0]) / (knots[1] - knots[0])
    return CubicSpline(knots, points, bc_type=((1, slope), (1, slope)))
