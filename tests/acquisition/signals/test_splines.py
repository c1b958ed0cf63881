"""Derivatives in pieces are those of the whole spline."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, make_interp_spline

from acquisition.signals import splines
from acquisition.signals.splines import quintic_derivatives, spline_at
from config.arrays import FloatArray

EXACT = 1e-12


def relative_error(found: FloatArray, expected: FloatArray) -> float:
    return float(np.max(np.abs(found - expected)) / np.max(np.abs(expected)))


@pytest.mark.parametrize("rows", [6, 7, 8, 11, 701, 2000])
def test_derivatives_in_pieces_are_those_of_the_whole_spline(
    monkeypatch: pytest.MonkeyPatch, rows: int
) -> None:
    monkeypatch.setattr(splines, "_PIECE_ROWS", 700)
    step = 0.002
    time_s = np.arange(rows) * step
    values = np.stack([np.sin(3.0 * time_s), time_s**2, np.cos(70.0 * time_s)], axis=1)
    path = make_interp_spline(time_s, values, k=5)
    slope, curvature = quintic_derivatives(values, step)
    assert relative_error(slope, path(time_s, 1)) < EXACT
    # differences of rounded values, divided by the square of the step
    assert relative_error(curvature, path(time_s, 2)) < 1e3 * EXACT


@pytest.mark.parametrize("rows", [2, 5, 701, 3000])
def test_resampling_in_pieces_is_that_of_the_whole_spline(
    monkeypatch: pytest.MonkeyPatch, rows: int
) -> None:
    monkeypatch.setattr(splines, "_PIECE_ROWS", 500)
    jitter = np.random.default_rng(1).uniform(0.2, 1.8, rows)
    time_s = np.cumsum(0.002 * jitter)
    values = np.sin(3.0 * time_s) + np.cos(70.0 * time_s)
    grid = np.linspace(time_s[0], time_s[-1], 2 * rows)
    expected = CubicSpline(time_s, values)(grid)
    assert relative_error(spline_at(time_s, values, grid), expected) < EXACT


def test_a_quintic_polynomial_is_differentiated_exactly() -> None:
    time_s = np.arange(30) * 0.1
    polynomial = np.polynomial.Polynomial([1.0, -2.0, 0.5, 3.0, -1.0, 0.25])
    slope, curvature = quintic_derivatives(polynomial(time_s)[:, np.newaxis], 0.1)
    assert relative_error(slope[:, 0], polynomial.deriv()(time_s)) < EXACT
    assert relative_error(curvature[:, 0], polynomial.deriv(2)(time_s)) < EXACT
