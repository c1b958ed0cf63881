"""Smooth curves over time through rows of joint positions, from rest to rest."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from config.arrays import FloatArray

FEWEST_ROWS: Final = 6
"""Smallest number of rows from which a curve through positions alone can be computed."""
TimedCurve = Callable[[FloatArray, int], FloatArray]
"""Function of times [s] and an order: returns positions for order 0, else their derivative of this
order.
"""


def curve_through_positions(time_s: FloatArray, position: FloatArray) -> TimedCurve:
    """Return the quintic spline of class C4 through positions, at rest at both ends.

    Args:
        time_s: Shape (m,), at least `FEWEST_ROWS`. Times, increasing [s].
        position: Shape (m, n). Positions [rad or m].
    """
    from scipy.interpolate import make_interp_spline  # a slow import that few motions need

    rest = [(1, np.zeros(position.shape[1])), (2, np.zeros(position.shape[1]))]
    return make_interp_spline(time_s, position, k=5, bc_type=(rest, rest))  # type: ignore[arg-type]


def curve_through_velocities(
    time_s: FloatArray, position: FloatArray, velocity: FloatArray
) -> TimedCurve:
    """Return the piecewise quintic of class C3 through positions and velocities.

    The accelerations of the rows make the third derivative continuous; those of both ends are zero.
    On an interval h from row 0 to row 1,

        q'''(0) = 60 (q1 - q0) / h^3 - (36 v0 + 24 v1) / h^2 - (9 a0 - 3 a1) / h
        q'''(h) = 60 (q1 - q0) / h^3 - (24 v0 + 36 v1) / h^2 + (9 a1 - 3 a0) / h

    Args:
        time_s: Shape (m,), at least two. Times, increasing [s].
        position, velocity: Shape (m, n). Positions and velocities [rad or m, per s].
    """
    from scipy.interpolate import PPoly
    from scipy.linalg import solve_banded

    h = np.diff(time_s)[:, np.newaxis]
    change, v0, v1 = np.diff(position, axis=0), velocity[:-1], velocity[1:]
    acceleration = np.zeros_like(position)
    if len(time_s) > 2:
        at_begin = 60.0 * change / h**3 - (36.0 * v0 + 24.0 * v1) / h**2
        at_end = 60.0 * change / h**3 - (24.0 * v0 + 36.0 * v1) / h**2
        bands = np.zeros((3, len(time_s) - 2))
        bands[0, 1:] = bands[2, :-1] = -3.0 / h[1:-1, 0]
        bands[1] = 9.0 / h[:-1, 0] + 9.0 / h[1:, 0]
        acceleration[1:-1] = solve_banded((1, 1), bands, at_begin[1:] - at_end[:-1])
    a0, a1 = acceleration[:-1], acceleration[1:]
    quintic = [
        (12.0 * change - 6.0 * (v1 + v0) * h + (a1 - a0) * h**2) / (2.0 * h**5),
        (-30.0 * change + (14.0 * v1 + 16.0 * v0) * h + (3.0 * a0 - 2.0 * a1) * h**2)
        / (2.0 * h**4),
        (20.0 * change - (8.0 * v1 + 12.0 * v0) * h - (3.0 * a0 - a1) * h**2) / (2.0 * h**3),
        a0 / 2.0,
        v0,
        position[:-1],
    ]
    return PPoly(np.array(quintic), time_s)
