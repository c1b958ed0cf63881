"""The splines are those of scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, make_interp_spline

from acquisition.signals import splines
from acquisition.signals.splines import NotAKnotSpline, quintic_derivatives
from config.arrays import FloatArray

EXACT = 1e-12


def relative_error(found: FloatArray, expected: FloatArray) -> float:
    return float(np.max(np.abs(found - expected)) / np.max(np.abs(expected)))


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("knots", [2, 3, 4, 5, 400])
def test_the_cubic_spline_is_that_of_scipy(knots: int, order: int) -> None:
    random = np.random.default_rng(knots)
    x = np.cumsum(random.uniform(0.5, 1.5, knots))
    y = random.normal(size=(knots, 3))
    at = np.concatenate([x, random.uniform(x[0] - 0.5, x[-1] + 0.5, 200)])
    expected = CubicSpline(x, y)(at, order)
    found = NotAKnotSpline(x, y)(at, order)
    assert found.shape == expected.shape
    assert np.max(np.abs(found - expected)) <= EXACT * max(1.0, np.max(np.abs(expected)))
    of_one = NotAKnotSpline(x, y[:, 0])(at, order)
    assert of_one.shape == at.shape
    assert np.array_equal(of_one, found[:, 0])


@pytest.mark.parametrize("rows", [6, 7, 8, 11, 701, 2000])
def test_the_quintic_derivatives_are_those_of_scipy(
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


def test_a_quintic_polynomial_is_differentiated_exactly() -> None:
    time_s = np.arange(30) * 0.1
    polynomial = np.polynomial.Polynomial([1.0, -2.0, 0.5, 3.0, -1.0, 0.25])
    slope, curvature = quintic_derivatives(polynomial(time_s)[:, np.newaxis], 0.1)
    assert relative_error(slope[:, 0], polynomial.deriv()(time_s)) < EXACT
    assert relative_error(curvature[:, 0], polynomial.deriv(2)(time_s)) < EXACT
