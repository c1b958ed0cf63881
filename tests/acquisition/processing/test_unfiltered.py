"""Signals without the low-pass filter, and the window filter for the torque and the regressor
columns.
"""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.motion.samples import Phase
from acquisition.processing.smoothing import smooth_nonperiodic
from acquisition.processing.unfiltered import (
    smoothing_width,
    window_mean,
    window_reach,
)
from acquisition.recording.recording import Recording
from acquisition.signals.splines import quintic_derivatives
from config.arrays import FloatArray

STEP_S = 0.001


def path(time_s: FloatArray) -> FloatArray:
    return np.stack([np.sin(3.0 * time_s), 0.4 * np.cos(5.0 * time_s)], axis=1)


def recording(step_s: float = STEP_S, duration_s: float = 4.0, bits: int = 0) -> Recording:
    time_s = np.arange(0.0, duration_s, step_s)
    position = path(time_s)
    if bits:
        step = 2.0 * np.pi / 2**bits
        position = np.round(position / step) * step
    return Recording(
        joint_names=("a", "b"),
        time_s=time_s,
        position=position,
        torque_nm=10.0 * position,
        valid=np.ones(len(time_s), dtype=np.bool_),
        phase=np.full(len(time_s), Phase.MAIN, dtype=np.uint8),
        sample_index=np.arange(len(time_s)),
        source="cell",
    )


def test_the_window_is_3_db_down_at_its_cut_off_without_phase_shift() -> None:
    time_s = np.arange(0.0, 4.0, STEP_S)
    wave = np.sin(2.0 * np.pi * 10.0 * time_s)[:, np.newaxis]
    rows = np.arange(500, 3500)
    mean = window_mean(wave, rows, STEP_S, 10.0)
    np.testing.assert_allclose(mean, np.sqrt(0.5) * wave[rows], atol=0.02)


def test_the_window_spreads_a_jump_over_its_reach_and_no_further() -> None:
    jump = np.where(np.arange(1000) < 500, -1.0, 1.0)[:, np.newaxis]
    reach = window_reach(STEP_S, 10.0)
    assert reach == 36
    mean = window_mean(jump, np.arange(1000), STEP_S, 10.0)[:, 0]
    np.testing.assert_allclose(mean[: 500 - reach], -1.0, atol=1e-12)
    np.testing.assert_allclose(mean[500 + reach :], 1.0, atol=1e-12)
    assert np.all(np.abs(mean[500 - reach : 500 + reach]) < 1.0)


def test_filtering_a_part_equals_that_part_of_the_filtered_whole() -> None:
    values = np.random.default_rng(0).normal(size=(800, 3, 2))
    rows = np.arange(100, 700, 12)
    whole = window_mean(values, np.arange(800), STEP_S, 10.0)
    np.testing.assert_allclose(
        window_mean(values[50:750], rows - 50, STEP_S, 10.0), whole[rows], atol=1e-12
    )


def test_derivatives_are_those_of_the_position() -> None:
    time_s = np.arange(0.0, 4.0, STEP_S)
    velocity, acceleration = quintic_derivatives(path(time_s), STEP_S)
    np.testing.assert_allclose(velocity[50:-50, 0], 3.0 * np.cos(3.0 * time_s)[50:-50], atol=1e-8)
    np.testing.assert_allclose(
        acceleration[50:-50, 0], -9.0 * np.sin(3.0 * time_s)[50:-50], atol=1e-5
    )


@pytest.mark.parametrize(
    ("step_s", "bits", "width_s"),
    [(1e-3, 0, 0.0), (1e-3, 19, 0.0), (1e-3, 16, 7.7e-3), (1e-3, 14, 8e-3), (1e-2, 14, 0.0)],
)
def test_only_a_coarse_encoder_is_smoothed(step_s: float, bits: int, width_s: float) -> None:
    position = recording(step_s, bits=bits).position
    assert smoothing_width(position, step_s) == pytest.approx(width_s, rel=0.05)


def test_a_noisy_position_is_smoothed_like_a_coarse_one() -> None:
    noise = 2.8e-5 * np.random.default_rng(1).normal(size=(4000, 2))  # a resolution of 16 bits
    assert smoothing_width(recording().position + noise, STEP_S) == pytest.approx(7.7e-3, rel=0.1)


def test_a_smoothed_recording_keeps_its_unfiltered_signals() -> None:
    smooth = smooth_nonperiodic(recording(), 10.0)
    source, rows = smooth.unfiltered, smooth.unfiltered_row
    assert source is not None
    assert rows is not None
    np.testing.assert_array_equal(source.time_s[rows], smooth.time_s)
    np.testing.assert_allclose(source.position, path(source.time_s), atol=1e-12)
    np.testing.assert_allclose(source.torque_nm, 10.0 * source.position, atol=1e-9)


def test_a_gap_also_splits_the_unfiltered_rows() -> None:
    whole = recording(duration_s=6.0)
    kept = (whole.time_s < 2.0) | (whole.time_s > 3.0)
    cut = Recording(
        joint_names=whole.joint_names,
        time_s=whole.time_s[kept],
        position=whole.position[kept],
        torque_nm=whole.torque_nm[kept],
        valid=whole.valid[kept],
        phase=whole.phase[kept],
        sample_index=whole.sample_index[kept],
        source="cell",
    )
    smooth = smooth_nonperiodic(cut, 10.0)
    source, rows = smooth.unfiltered, smooth.unfiltered_row
    assert source is not None
    assert rows is not None
    np.testing.assert_array_equal(source.segment[rows], smooth.segment)
    np.testing.assert_allclose(source.position, path(source.time_s), atol=1e-9)
