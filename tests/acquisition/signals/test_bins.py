"""Frequency bins: exact differentiation and compensation of the anti-alias filter."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from acquisition.motion.fourier import FourierTrajectory
from acquisition.signals.bins import (
    differentiate_on_bins,
    divide_filter,
    filter_response,
    from_bins,
    to_bins,
)
from config.cell.torque_filter import ButterworthFilter
from config.errors import ConfigError
from tests.builders.raised_codes import raises_code

K, T = 1250, 0.008


def trajectory(seed: int = 0, harmonics: int = 5) -> FourierTrajectory:
    rng = np.random.default_rng(seed)
    return FourierTrajectory(
        joint_names=("a", "b", "c"),
        sample_period_s=T,
        samples_per_period=K,
        offset=rng.standard_normal(3),
        sine=rng.standard_normal((harmonics, 3)),
        cosine=rng.standard_normal((harmonics, 3)),
    )


class TestDifferentiation:
    @settings(max_examples=20)
    @given(seed=st.integers(0, 10_000), harmonics=st.integers(1, 40))
    def test_differentiation_of_a_fourier_series_is_exact(self, seed: int, harmonics: int) -> None:
        truth = trajectory(seed, harmonics)
        t = truth.sample_times_s
        q, v, a = differentiate_on_bins(truth.position(t), T, harmonics)
        for found, exact in (
            (q, truth.position(t)),
            (v, truth.velocity(t)),
            (a, truth.acceleration(t)),
        ):
            np.testing.assert_allclose(found, exact, atol=1e-10 * np.abs(exact).max())

    def test_a_finer_grid_gives_the_same_signal(self) -> None:
        truth = trajectory()
        q, v, a = differentiate_on_bins(truth.position(truth.sample_times_s), T, 5, oversampling=4)
        t = np.arange(4 * K) * T / 4
        np.testing.assert_allclose(q, truth.position(t), atol=1e-12)
        np.testing.assert_allclose(v, truth.velocity(t), atol=1e-11)
        np.testing.assert_allclose(a, truth.acceleration(t), atol=1e-10)

    def test_differentiation_removes_frequencies_above_the_harmonics(self) -> None:
        truth = trajectory(harmonics=6)
        only_5 = FourierTrajectory(
            truth.joint_names, T, K, truth.offset, truth.sine[:5], truth.cosine[:5]
        )
        t = truth.sample_times_s
        q, _, _ = differentiate_on_bins(truth.position(t), T, 5)
        np.testing.assert_allclose(q, only_5.position(t), atol=1e-12)

    def test_differentiation_of_an_odd_number_of_samples_is_exact(self) -> None:
        t = np.arange(2499) * 0.012
        w = 2 * np.pi / (2499 * 0.012)
        _, v, _ = differentiate_on_bins(np.sin(20 * w * t)[:, np.newaxis], 0.012, 25)
        np.testing.assert_allclose(v[:, 0], 20 * w * np.cos(20 * w * t), atol=1e-9)

    def test_harmonics_beyond_half_the_samples_are_refused(self) -> None:
        with raises_code(ConfigError, "RID-MOTION-BAND", "10"):
            differentiate_on_bins(np.zeros((10, 1)), T, 5)


class TestBins:
    def test_a_sine_of_amplitude_a_has_a_bin_of_a_half(self) -> None:
        x = 3.0 * np.sin(2 * np.pi * 7 * np.arange(100) / 100)[:, np.newaxis] + 2.0
        bins = to_bins(x, 10)
        assert bins.shape == (11, 1)
        assert abs(bins[7, 0]) == pytest.approx(1.5)
        assert bins[0, 0] == pytest.approx(2.0)
        np.testing.assert_allclose(from_bins(bins, 100), x, atol=1e-12)


class TestFilter:
    butterworth = ButterworthFilter(order=8, cutoff_hz=40.0)

    def test_the_filter_has_a_gain_of_0_7071_at_its_cut_off_and_1_at_zero(self) -> None:
        response = filter_response(self.butterworth, np.array([0.0, 40.0]))
        np.testing.assert_allclose(np.abs(response), [1.0, np.sqrt(0.5)], rtol=1e-12)

    @pytest.mark.parametrize("order", [1, 2, 5, 8])
    def test_the_filter_is_the_analog_filter_that_scipy_computes(self, order: int) -> None:
        f = np.linspace(0.0, 100.0, 57)
        b, a = signal.butter(order, 2 * np.pi * 40.0, analog=True)
        _, expected = signal.freqs(b, a, 2 * np.pi * f)
        found = filter_response(ButterworthFilter(order=order, cutoff_hz=40.0), f)
        np.testing.assert_allclose(found, expected, rtol=1e-8)

    def test_compensation_recovers_the_signal_before_the_filter(self) -> None:
        truth = trajectory(harmonics=50)  # up to 5 Hz
        x = truth.position(truth.sample_times_s)
        response = filter_response(self.butterworth, np.arange(51) / (K * T))
        filtered = from_bins(to_bins(x, 50) * response[:, np.newaxis], K)
        assert np.abs(filtered - x).max() > 0.1
        np.testing.assert_allclose(divide_filter(filtered, T, self.butterworth, 50), x, atol=1e-10)

    def test_compensation_at_zero_gain_is_refused(self) -> None:
        with raises_code(ConfigError, "RID-MOTION-BAND", "600", "60", "10"):
            divide_filter(np.zeros((K, 1)), T, ButterworthFilter(order=8, cutoff_hz=10.0), 600)

    def test_without_a_filter_the_signal_is_limited_to_the_bins(self) -> None:
        truth = trajectory()
        x = truth.position(truth.sample_times_s)
        np.testing.assert_allclose(divide_filter(x, T, None, 5), x, atol=1e-12)
