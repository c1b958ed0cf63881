"""Smoothing of recordings without periods, and resampling of imported periods and temperatures."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from scipy import signal

from acquisition.motion.samples import Phase
from acquisition.processing.imported_periods import resample_periods
from acquisition.processing.smoothing import low_pass, smooth_nonperiodic
from acquisition.recording.recording import Recording
from config.errors import ConfigError, DataQualityError
from tests.builders.raised_codes import raises_code

W = 2.0 * np.pi * 0.5


def truth(t: np.ndarray) -> np.ndarray:
    return np.stack([np.sin(W * t) + 0.3 * np.sin(2.5 * W * t), 0.5 * np.cos(W * t)], axis=1)


def recording_with_uneven_stamps(
    duration_s: float = 12.0, seed: int = 0, noise: float = 0.0
) -> Recording:
    """Return a recording whose time stamps are 8, 10 or 12 ms apart."""
    rng = np.random.default_rng(seed)
    t = 100.0 + np.cumsum(rng.choice([0.008, 0.010, 0.012], round(duration_s / 0.01)))
    rows = len(t)
    return Recording(
        joint_names=("a", "b"),
        time_s=t,
        position=truth(t) + 1e-4 * noise * rng.standard_normal((rows, 2)),
        torque_nm=10.0 * truth(t) + noise * rng.standard_normal((rows, 2)),
        valid=np.ones(rows, dtype=bool),
        phase=np.full(rows, Phase.MAIN, dtype=np.uint8),
        sample_index=np.full(rows, -1),
        source="import",
    )


def part(recording: Recording, keep: np.ndarray) -> Recording:
    return replace(
        recording,
        time_s=recording.time_s[keep],
        position=recording.position[keep],
        torque_nm=recording.torque_nm[keep],
        valid=recording.valid[keep],
        phase=recording.phase[keep],
        sample_index=recording.sample_index[keep],
    )


class TestLowPass:
    def test_the_low_pass_is_3_db_down_at_its_cut_off_without_phase(self) -> None:
        t = np.arange(4000) * 0.01
        x = np.sin(2 * np.pi * 9.4 * t)[:, np.newaxis]
        y = low_pass(x, 0.01, 9.4)[500:-500]
        np.testing.assert_allclose(y, np.sqrt(0.5) * x[500:-500], atol=2e-3)

    def test_the_low_pass_passes_frequencies_well_below(self) -> None:
        t = np.arange(2000) * 0.01
        x = np.sin(2 * np.pi * 2.0 * t)[:, np.newaxis]
        np.testing.assert_allclose(low_pass(x, 0.01, 9.4)[200:-200], x[200:-200], atol=1e-3)

    @pytest.mark.parametrize("shape", [(1, 2), (2, 3), (9, 1), (400,), (900, 70), (300, 4, 5)])
    @pytest.mark.parametrize("order", ["C", "F"])
    def test_the_low_pass_is_a_forward_backward_butterworth_filter_of_order_4(
        self, shape: tuple[int, ...], order: Literal["C", "F"]
    ) -> None:
        x = np.asarray(np.cumsum(np.random.default_rng(1).normal(size=shape), axis=0), order=order)
        before = x.copy()
        warped = np.tan(np.pi * 3.0 * 0.01) / (np.sqrt(2.0) - 1.0) ** (1.0 / 8.0)
        sections = signal.butter(4, np.arctan(warped) / np.pi, fs=1.0, output="sos")
        expected = signal.sosfiltfilt(sections, x, axis=0, padlen=min(shape[0] - 1, 100))
        np.testing.assert_allclose(low_pass(x, 0.01, 3.0), expected, atol=1e-10)
        np.testing.assert_array_equal(x, before)

    def test_a_cut_off_above_the_nyquist_frequency_is_refused(self) -> None:
        with raises_code(ConfigError, "RID-RECORDING-CUTOFF", "45"):
            low_pass(np.zeros((100, 1)), 0.01, 49.0)


class TestSmoothing:
    def test_smoothing_estimates_the_derivatives_of_the_motion(self) -> None:
        smooth = smooth_nonperiodic(recording_with_uneven_stamps(), 9.4)
        t = smooth.time_s
        h = 1e-4
        velocity = (truth(t + h) - truth(t - h)) / (2 * h)
        acceleration = (truth(t + h) - 2 * truth(t) + truth(t - h)) / h**2
        np.testing.assert_allclose(smooth.position, truth(t), atol=2e-4)
        np.testing.assert_allclose(smooth.velocity, velocity, atol=5e-3)
        np.testing.assert_allclose(smooth.acceleration, acceleration, atol=0.05)
        np.testing.assert_allclose(smooth.torque_nm, 10.0 * truth(t), atol=2e-3)

    def test_a_smoothed_recording_is_uniform_and_has_its_cut_off(self) -> None:
        smooth = smooth_nonperiodic(recording_with_uneven_stamps(), 9.4)
        np.testing.assert_allclose(np.diff(smooth.time_s), smooth.sample_period_s, rtol=1e-6)
        assert smooth.sample_period_s == pytest.approx(0.01)
        assert smooth.cutoff_hz == 9.4
        assert (smooth.segment == 0).all()

    def test_smoothing_reduces_noise(self) -> None:
        smooth = smooth_nonperiodic(recording_with_uneven_stamps(duration_s=40.0, noise=1.0), 5.0)
        error = smooth.torque_nm - 10.0 * truth(smooth.time_s)
        assert error.std() < 0.4

    def test_smoothing_splits_at_a_gap_and_leaves_it_empty(self) -> None:
        recording = recording_with_uneven_stamps()
        gap = (recording.time_s > 104.0) & (recording.time_s < 105.0)
        smooth = smooth_nonperiodic(part(recording, ~gap), 9.4)
        assert set(smooth.segment.tolist()) == {0, 1}
        assert not ((smooth.time_s > 104.0) & (smooth.time_s < 105.0)).any()
        np.testing.assert_allclose(smooth.position, truth(smooth.time_s), atol=5e-4)

    def test_smoothing_ignores_invalid_rows(self) -> None:
        recording = recording_with_uneven_stamps()
        position, valid = recording.position.copy(), recording.valid.copy()
        position[500] = 1e3
        valid[500] = False
        smooth = smooth_nonperiodic(replace(recording, position=position, valid=valid), 9.4)
        np.testing.assert_allclose(smooth.position, truth(smooth.time_s), atol=5e-4)

    def test_parts_that_are_too_short_are_refused(self) -> None:
        recording = recording_with_uneven_stamps(duration_s=4.0)
        shreds = np.arange(len(recording)) % 30 < 20
        with raises_code(DataQualityError, "RID-RECORDING-CUTOFF"):
            smooth_nonperiodic(part(recording, shreds), 9.4)
        with raises_code(DataQualityError, "RID-RECORDING-SHORT"):
            smooth_nonperiodic(part(recording, np.arange(len(recording)) < 1), 9.4)


class TestResamplePeriods:
    def test_whole_periods_are_resampled_on_a_uniform_grid(self) -> None:
        recording = resample_periods(recording_with_uneven_stamps(duration_s=13.0), 4.0)
        assert recording.samples_per_period == 400
        assert recording.sample_period_s == pytest.approx(0.01)
        assert len(recording) == 3 * 400
        np.testing.assert_array_equal(recording.sample_index, np.arange(1200))
        np.testing.assert_allclose(recording.position, truth(recording.time_s), atol=1e-6)
        assert recording.valid.all()

    def test_the_rows_of_a_gap_are_marked(self) -> None:
        recording = recording_with_uneven_stamps(duration_s=13.0)
        gap = (recording.time_s > 104.0) & (recording.time_s < 104.2)
        resampled = resample_periods(part(recording, ~gap), 4.0)
        inside = (resampled.time_s > 104.0) & (resampled.time_s < 104.2)
        assert not resampled.valid[inside].any()
        assert resampled.valid[~inside].sum() > len(resampled) - 25

    @pytest.mark.parametrize(("period_s", "share"), [(3.7, 95), (2.0, 29), (3.96, 15)])
    def test_a_motion_that_does_not_repeat_after_its_period_is_refused(
        self, period_s: float, share: int
    ) -> None:
        recording = recording_with_uneven_stamps(duration_s=13.0)
        with raises_code(DataQualityError, "RID-IMPORT-PERIOD", f"{share} %", "4 s"):
            resample_periods(recording, period_s)

    def test_a_motion_that_never_repeats_gets_no_period(self) -> None:
        recording = recording_with_uneven_stamps(duration_s=13.0)
        away = replace(recording, position=recording.position + 0.5 * recording.time_s[:, None])
        with raises_code(DataQualityError, "RID-IMPORT-PERIOD") as caught:
            resample_periods(away, 4.0)
        assert "repeat after about" not in str(caught.value)

    def test_one_period_may_differ(self) -> None:
        recording = recording_with_uneven_stamps(duration_s=13.0)
        moved = recording.position + np.where(recording.time_s[:, None] < 103.0, 0.5, 0.0)
        assert len(resample_periods(replace(recording, position=moved), 4.0)) == 1200

    def test_less_than_two_periods_are_refused(self) -> None:
        with raises_code(DataQualityError, "RID-IMPORT-RANGE"):
            resample_periods(recording_with_uneven_stamps(duration_s=13.0), 8.0)


class TestTemperature:
    @staticmethod
    def warming() -> Recording:
        recording = recording_with_uneven_stamps(duration_s=13.0)
        warmth = 300.0 + 0.5 * (recording.time_s - 100.0)
        return replace(recording, temperature_k=np.stack([warmth, warmth + 5.0], axis=1))

    def test_temperature_follows_its_stamps_without_overshoot(self) -> None:
        smooth = smooth_nonperiodic(self.warming(), 9.4)
        expected = 300.0 + 0.5 * (smooth.time_s - 100.0)
        assert smooth.temperature_k is not None
        np.testing.assert_allclose(smooth.temperature_k[:, 0], expected, atol=1e-9)
        np.testing.assert_allclose(smooth.temperature_k[:, 1], expected + 5.0, atol=1e-9)

        recording = recording_with_uneven_stamps()
        step = np.where(recording.time_s < 106.0, 300.0, 301.0)[:, np.newaxis] * np.ones(2)
        smooth = smooth_nonperiodic(replace(recording, temperature_k=step), 9.4)
        assert smooth.temperature_k is not None
        assert smooth.temperature_k.min() == 300.0
        assert smooth.temperature_k.max() == 301.0

    def test_temperature_is_resampled_with_the_periods(self) -> None:
        resampled = resample_periods(self.warming(), 4.0)
        expected = 300.0 + 0.5 * (resampled.time_s - 100.0)
        assert resampled.temperature_k is not None
        np.testing.assert_allclose(resampled.temperature_k[:, 0], expected, atol=1e-9)

    def test_temperature_is_unknown_if_it_was_not_recorded(self) -> None:
        assert smooth_nonperiodic(recording_with_uneven_stamps(), 9.4).temperature_k is None
        assert (
            resample_periods(recording_with_uneven_stamps(duration_s=13.0), 4.0).temperature_k
            is None
        )


def test_a_cut_off_too_high_for_the_sampling_period_is_refused_in_seconds() -> None:
    with raises_code(ConfigError, "RID-RECORDING-CUTOFF", "10", "s", "0.045"):
        low_pass(np.zeros((9, 1)), 10.0, 10.0)
    with raises_code(ConfigError, "RID-RECORDING-CUTOFF", "10", "ms", "45"):
        low_pass(np.zeros((9, 1)), 0.01, 60.0)


@pytest.mark.parametrize("origin_s", [802.227, 90_000.0, -3.3])
def test_the_last_digit_of_the_stamps_does_not_change_the_samples(origin_s: float) -> None:
    recording = recording_with_uneven_stamps()
    # 2 / (10 Hz) are 20 steps of 10 ms, but 20.00000000001 if the stamps are rounded to a double
    exact = 0.01 * np.arange(len(recording.time_s), dtype=np.float64)
    stamps = (exact, (exact + origin_s) - origin_s)
    first, second = (
        smooth_nonperiodic(replace(recording, time_s=each), 10.0).time_s for each in stamps
    )
    assert len(first) == len(second) == len(exact) - 1 - 2 * 21
