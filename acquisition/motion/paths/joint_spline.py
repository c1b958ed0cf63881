"""Smooth joint curve through poses, as a function of its length."""

from __future__ import annotations

from typing import TYPE_CHECKING

from config.arrays import FloatArray

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline


def joint_spline(knots: FloatArray, points: FloatArray) -> CubicSpline:
    """Return the cubic spline through poses; a straight line for two poses.

    Args:
        knots: Shape (m,). Length at each pose, increasing.
        points: Shape (m, n). Poses, at least two.
    """
    from scipy.interpolate import CubicSpline  # a slow import that few motions need

    if len(points) > 2:
        return CubicSpline(knots, points)
    slope = (points[1] - points[0]) / (knots[1] - knots[0])
    return CubicSpline(knots, points, bc_type=((1, slope), (1, slope)))
