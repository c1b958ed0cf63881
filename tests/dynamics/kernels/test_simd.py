"""Arithmetic of eight samples at once, compared with numpy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

from dynamics.kernels.simd import gather, load, scatter, spread, store
from dynamics.kernels.vectors import eight_indices, sin_cos


@njit
def _sin_cos(x, out):
    for first in range(0, len(x), 8):
        samples = eight_indices(first, len(x))
        sine, cosine = sin_cos(gather(x, samples, 0))
        scatter(sine, out, samples, 0)
        scatter(cosine, out, samples, 1)


@njit
def _arithmetic(x, out):
    for first in range(0, len(x), 8):
        samples = eight_indices(first, len(x))
        a, b = gather(x, samples, 0), gather(x, samples, 1)
        scatter(a + b, out, samples, 0)
        scatter(a - 2.5, out, samples, 1)
        scatter(2.5 - a, out, samples, 2)
        scatter(a * b, out, samples, 3)
        scatter(-a, out, samples, 4)
        scatter(spread(3.0) * b, out, samples, 5)


@njit
def _through_memory(x, tile, out):
    samples = eight_indices(0, 8)
    store(gather(x, samples, 0), tile, 1, 2)
    scatter(load(tile, 1, 2), out, samples, 1)


@pytest.mark.parametrize("largest", [1.0, 4.0, 1e3, 1e6])
def test_sine_and_cosine_agree_with_a_wider_format(largest) -> None:
    x = np.random.default_rng(0).uniform(-largest, largest, (20_000, 1))
    x[:5, 0] = 0.0, np.pi / 4, -np.pi / 2, np.pi, largest
    out = np.empty((len(x), 2))
    _sin_cos(x, out)
    wide = x[:, 0].astype(np.longdouble)
    expected = np.column_stack([np.sin(wide), np.cos(wide)])
    assert np.abs(out - expected).max() < 3e-16


def test_values_that_are_not_numbers_stay_so() -> None:
    out = np.zeros((2, 2))
    _sin_cos(np.array([[np.nan], [np.inf]]), out)
    assert np.isnan(out).all()


@given(st.lists(st.tuples(*[st.floats(-1e9, 1e9)] * 2), min_size=1, max_size=20))
def test_every_sample_is_computed_at_any_position(pairs) -> None:
    x = np.array(pairs)
    a, b = x.T
    out = np.zeros((len(x), 6))
    _arithmetic(x, out)
    np.testing.assert_array_equal(
        out, np.column_stack([a + b, a - 2.5, 2.5 - a, a * b, -a, 3.0 * b])
    )


def test_lanes_are_contiguous_in_memory() -> None:
    x = np.random.default_rng(1).standard_normal((8, 1))
    tile, out = np.zeros((2, 4, 8)), np.zeros((8, 3))
    _through_memory(x, tile, out)
    np.testing.assert_array_equal(tile[1, 2], x[:, 0])
    np.testing.assert_array_equal(out[:, 1], x[:, 0])
    assert np.count_nonzero(tile) == np.count_nonzero(out) == 8
