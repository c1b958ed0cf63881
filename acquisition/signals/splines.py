"""`NotAKnotSpline`, `quintic_derivatives`: splines through samples, without further conditions.

At the second and the last but one knot (cubic), or at two knots of each end (quintic), the highest
derivative is continuous too ("not a knot"). `scipy.interpolate` computes the same splines
(tested), but its import takes a tenth of the processor time of most commands.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import FloatArray

_JUMP: Final = (1.0, -6.0, 15.0, -20.0, 15.0, -6.0, 1.0)
"""Jump of a quintic spline's highest derivative at a knot, from the seven coefficients around."""

_VALUE: Final = (1.0 / 120.0, 26.0 / 120.0, 66.0 / 120.0, 26.0 / 120.0, 1.0 / 120.0)
_SLOPE: Final = (-1.0 / 24.0, -10.0 / 24.0, 0.0, 10.0 / 24.0, 1.0 / 24.0)
_CURVATURE: Final = (1.0 / 6.0, 2.0 / 6.0, -1.0, 2.0 / 6.0, 1.0 / 6.0)
"""Value and derivatives of a quintic spline at a knot, from the five coefficients around it."""

_REACH: Final = 6
"""Columns on each side of the diagonal."""

_PIECE_ROWS: Final = 8192
"""Rows whose derivatives are computed at a time, to limit the memory."""

_MARGIN_ROWS: Final = 64
"""Rows before and after a piece that are computed too. The effect of a value on the derivatives
decreases with the distance in rows n as 0.431^n, so that it is below the rounding error there."""


class NotAKnotSpline:
    """Cubic spline through points; a parabola through three points, a line through two.

    Args:
        x: Shape (m,). Knots, increasing; at least two.
        y: Shape (m, ...). Values at the knots.
    """

    def __init__(self, x: FloatArray, y: FloatArray) -> None:
        self.x = np.asarray(x, dtype=float)
        self._y = np.asarray(y, dtype=float)
        width = np.diff(self.x)
        if not len(width) or not np.all(width > 0.0):
            raise ValueError("a spline needs at least two knots in increasing order")
        of_rows = (-1,) + (1,) * (self._y.ndim - 1)
        self._width = width.reshape(of_rows)
        chord = np.diff(self._y, axis=0) / self._width
        self._slope = _knot_slopes(width, chord)
        bend = self._slope[:-1] + self._slope[1:] - 2.0 * chord
        self._cubic = bend / self._width**2
        self._square = (chord - self._slope[:-1] - bend) / self._width

    def __call__(self, at: FloatArray, order: int = 0) -> FloatArray:
        """Return the values, or a derivative; the end pieces continue beyond the end knots.

        Args:
            at: Shape (n,). Requested places.
            order: 0 for values, 1 for the first derivative, 2 for the second.

        Returns:
            Shape (n, ...).
        """
        at = np.asarray(at, dtype=float)
        piece = np.searchsorted(self.x[1:-1], at, side="right")
        past = (at - self.x[piece]).reshape((-1,) + (1,) * (self._y.ndim - 1))
        factors = ((1.0, 1.0, 1.0), (3.0, 2.0, 1.0), (6.0, 2.0, 0.0))[order]
        out = factors[0] * self._cubic[piece]
        lower = (self._square, self._slope, self._y)[: 3 - order]
        for factor, coefficients in zip((*factors[1:], 1.0), lower, strict=False):
            out *= past
            out += factor * coefficients[piece]
        return np.asarray(out)


def _knot_slopes(width: FloatArray, chord: FloatArray) -> FloatArray:
    """Return the slopes at the knots, (m, ...), from the pieces' widths and mean slopes."""
    if len(width) == 1:
        return np.concatenate([chord, chord])
    if len(width) == 2:
        bend = (chord[1] - chord[0]) / width.sum()
        return np.stack(
            [chord[0] - width[0] * bend, chord[0] + width[0] * bend, chord[1] + width[1] * bend]
        )
    from scipy.linalg import solve_banded  # a slow import that periodic runs do not need

    flat = chord.reshape(len(chord), -1)
    left, right = width[:-1], width[1:]
    bands = np.empty((3, len(width) + 1))
    wanted = np.empty((len(width) + 1, flat.shape[1]))
    bands[0, 2:], bands[1, 1:-1], bands[2, :-2] = left, 2.0 * (left + right), right
    wanted[1:-1] = 3.0 * (right[:, np.newaxis] * flat[:-1] + left[:, np.newaxis] * flat[1:])
    for end, (near, far), (own, other) in (
        (0, width[:2], flat[:2]),
        (-1, width[:-3:-1], flat[:-3:-1]),
    ):
        both = near + far
        bands[1, end] = far
        wanted[end] = ((near + 2.0 * both) * far * own + near**2 * other) / both
    bands[0, 1], bands[2, -2] = width[:2].sum(), width[-2:].sum()
    bands[0, 0] = bands[2, -1] = 0.0
    slopes = solve_banded((1, 1), bands, wanted, overwrite_ab=True, overwrite_b=True)
    return np.asarray(slopes).reshape(-1, *chord.shape[1:])


def quintic_derivatives(values: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    """Return first and second derivative of a quintic spline at its uniform knots.

    Args:
        values: Shape (m, n). Values at the knots, at least six rows.
        step: Distance of the knots.
    """
    rows = len(values)
    if rows < _REACH:
        raise ValueError("a quintic spline needs at least six knots")
    slope, curvature = np.empty((2, *values.shape))
    for first in range(0, rows, _PIECE_ROWS):
        own = slice(first, min(first + _PIECE_ROWS, rows))
        start = max(first - _MARGIN_ROWS, 0)
        piece = values[start : own.stop + _MARGIN_ROWS]
        inner = slice(own.start - start, own.stop - start)
        of_piece = _quintic_derivatives_of_piece(piece, step)
        slope[own], curvature[own] = (derivative[inner] for derivative in of_piece)
    return slope, curvature


def _quintic_derivatives_of_piece(values: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    from scipy.linalg import solve_banded

    rows = len(values)
    # unknown: coefficients of the B-splines around the knots -2 to m + 1
    bands = np.zeros((2 * _REACH + 1, rows + 4))
    for offset, part in zip(range(-2, 3), _VALUE, strict=True):
        bands[_REACH - offset, 2 + offset : 2 + offset + rows] = part
    for column, part in enumerate(_JUMP):
        for row in (0, 1):
            bands[_REACH - column, row + column] = part
            bands[_REACH + column, rows + 3 - row - column] = part
    wanted = np.zeros((rows + 4, values.shape[1]))
    wanted[2:-2] = values
    found = solve_banded((_REACH, _REACH), bands, wanted, overwrite_ab=True, overwrite_b=True)
    slope, curvature = (
        sum(part * found[k : k + rows] for k, part in enumerate(parts) if part)
        for parts in (_SLOPE, _CURVATURE)
    )
    return np.asarray(slope / step), np.asarray(curvature / step**2)
