from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from acquisition.processing.smoothing import low_pass
from acquisition.recording.recording import Recording
from config.cell.torque_filter import ButterworthFilter
from config.errors import EstimationError
from identification.equations.deconvolution import without_torque_filter
from tests.builders.raised_codes import raises_code

FILTER = ButterworthFilter(order=8, cutoff_hz=40.0)
STEP_S = 0.008


def recording_of(torque: np.ndarray, torque_filter: ButterworthFilter | None) -> Recording:
    rows = len(torque)
    return Recording(
        joint_names=("j",),
        time_s=np.arange(rows, dtype=np.float64) * STEP_S,
        position=np.zeros((rows, 1)),
        torque_nm=torque[:, np.newaxis],
        valid=np.ones(rows, dtype=np.bool_),
        phase=np.zeros(rows, dtype=np.uint8),
        sample_index=np.arange(rows),
        source="cell",
        sample_period_s=STEP_S,
        torque_filter=torque_filter,
    )


@pytest.fixture
def torque() -> np.ndarray:
    """Return 16 s of a smooth signal below 5 Hz, with eight samples per `STEP_S`."""
    random = np.random.default_rng(0)
    fine = np.arange(0.0, 16.0, STEP_S / 8.0)
    waves = [
        random.normal() * np.sin(2.0 * np.pi * f * fine + random.uniform(0.0, 6.0))
        for f in random.uniform(0.05, 5.0, 30)
    ]
    return np.asarray(20.0 + np.sum(waves, axis=0))


def test_the_effect_of_the_filter_is_compensated(torque: np.ndarray) -> None:
    b, a = signal.butter(8, 2.0 * np.pi * 40.0, analog=True)
    fine = np.arange(len(torque)) * STEP_S / 8.0
    start = torque[0]
    filtered = signal.lsim((b, a), torque - start, fine)[1] + start
    result = without_torque_filter(recording_of(filtered[::8], FILTER))
    assert result.torque_filter is None
    restored = low_pass(result.torque_nm, STEP_S, 10.0)[:, 0]
    inner = slice(100, -100)
    error = restored[inner] - low_pass(torque[::8, np.newaxis], STEP_S, 10.0)[inner, 0]
    untouched = filtered[::8][inner] - torque[::8][inner]
    assert np.abs(error).max() < 2e-3 * np.abs(untouched).max()


def test_a_constant_is_unchanged() -> None:
    result = without_torque_filter(recording_of(np.full(700, 12.5), FILTER))
    np.testing.assert_allclose(result.torque_nm, 12.5, rtol=1e-9)


def test_a_short_recording_is_accepted() -> None:
    result = without_torque_filter(recording_of(np.full(20, 3.0), FILTER))
    np.testing.assert_allclose(result.torque_nm, 3.0, rtol=1e-9)


def test_a_recording_without_a_filter_is_unchanged(torque: np.ndarray) -> None:
    recording = recording_of(torque, None)
    assert without_torque_filter(recording) is recording


def test_stamps_that_are_not_uniform_are_refused(torque: np.ndarray) -> None:
    with raises_code(EstimationError, "RID-RECORDING-CLOCK"):
        without_torque_filter(replace(recording_of(torque, FILTER), sample_period_s=None))
