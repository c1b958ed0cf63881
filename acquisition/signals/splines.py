"""`quintic_derivatives`: derivatives of uniformly sampled positions."""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import FloatArray

FEWEST_ROWS: Final = 6
"""Fewest rows that determine a quintic spline."""

_PIECE_ROWS: Final = 8192
"""Rows whose derivatives are computed at a time, to limit the memory."""

_MARGIN_ROWS: Final = 64
"""Rows before and after a piece that are computed too. The effect of a value on the derivatives
decreases with the distance in rows n as 0.431^n, so that it is below the rounding error there."""


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
    slope, curvature = np.empty((2, *values.shape))
    for first in range(0, rows, _PIECE_ROWS):
        own = slice(first, min(first + _PIECE_ROWS, rows))
        start = max(first - _MARGIN_ROWS, 0)
        piece = values[start : own.stop + _MARGIN_ROWS]
        spline = make_interp_spline(np.arange(len(piece)), piece, k=5)
        at = np.arange(own.start - start, own.stop - start)
        slope[own], curvature[own] = spline(at, 1) / step, spline(at, 2) / step**2
    return slope, curvature
