"""`quintic_derivatives`: derivatives of uniformly sampled positions."""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import FloatArray, release
from config.column_file import ColumnFile

FEWEST_ROWS: Final = 6
"""Fewest rows that determine a quintic spline."""

_PIECE_ROWS: Final = 8192
"""Rows whose derivatives are computed at a time, to limit the memory."""

_MARGIN_ROWS: Final = 64
"""Rows before and after a piece that are computed too. The effect of a value on the derivatives
decreases with the distance in rows n as 0.431^n, so that it is below the rounding error there."""


def spline_at(time_s: FloatArray, values: FloatArray, grid: FloatArray) -> FloatArray:
    """Return the cubic spline through values at other times, shape (times,).

    The spline is computed in pieces; it differs from that through all values by rounding errors.

    Args:
        time_s: Shape (m,). Increasing times of the values.
        values: Shape (m,). The values.
        grid: Shape (times,). Increasing times.
    """
    from scipy.interpolate import CubicSpline  # a slow import that few commands need

    resampled = np.empty(len(grid))
    for first in range(0, len(grid), _PIECE_ROWS):
        own = slice(first, first + _PIECE_ROWS)
        at = grid[own]
        begin, end = np.searchsorted(time_s, at[[0, -1]]).tolist()
        near = slice(max(begin - _MARGIN_ROWS, 0), end + _MARGIN_ROWS)
        resampled[own] = CubicSpline(time_s[near], values[near])(at)
    return resampled


def quintic_derivatives(values: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    """Return first and second derivative of a quintic spline at its uniform knots.

    The spline has no further conditions: at two knots of each end, its highest derivative is
    continuous too ("not a knot").

    Args:
        values: Shape (m, n). Values at the knots, at least six rows.
        step: Distance of the knots.
    """
    from scipy.interpolate import make_interp_spline  # a slow import that periodic runs do not need

    rows = len(values)
    if rows < FEWEST_ROWS:
        raise ValueError("a quintic spline needs at least six knots")
    slopes, curvatures = (ColumnFile(values.shape[1], rows) for _ in range(2))
    for first in range(0, rows, _PIECE_ROWS):
        own = slice(first, min(first + _PIECE_ROWS, rows))
        start = max(first - _MARGIN_ROWS, 0)
        piece = values[start : own.stop + _MARGIN_ROWS]
        spline = make_interp_spline(np.arange(len(piece)), piece, k=5)
        at = np.arange(own.start - start, own.stop - start)
        slopes.append(spline(at, 1) / step)
        curvatures.append(spline(at, 2) / step**2)
        release(values)
    return slopes.table(), curvatures.table()
