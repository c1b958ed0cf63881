"""Detection of a torque that its source updates less often than rows are recorded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition.motion.samples import Phase
from acquisition.processing.repeated_torque import find_repeated_torques, repeated_torque_sentence
from acquisition.recording.recording import Recording
from config.arrays import FloatArray

STEP_S = 0.002


def motion(rows: int = 5000) -> tuple[FloatArray, FloatArray]:
    time_s = np.arange(rows) * STEP_S
    position = np.stack([np.sin(time_s), np.cos(0.7 * time_s)], axis=1)
    torque = 30.0 * np.stack([np.cos(3.0 * time_s), np.sin(2.0 * time_s)], axis=1)
    return position, torque


def recording(position: FloatArray, torque: FloatArray) -> Recording:
    return Recording(
        joint_names=("a", "b"),
        time_s=STEP_S * np.arange(len(position), dtype=np.float64),
        position=position,
        torque_nm=torque,
        valid=np.ones(len(position), dtype=np.bool_),
        phase=np.full(len(position), Phase.MAIN, dtype=np.uint8),
        sample_index=np.arange(len(position)),
        source="import",
    )


def test_a_repeated_torque_is_detected_with_its_number_of_rows() -> None:
    position, torque = motion()
    rows = np.arange(len(torque))
    torque[:, 0] = torque[rows // 20 * 20, 0]
    found = find_repeated_torques(position, torque)
    assert found is not None
    assert found.rows.tolist() == [20, 1]
    np.testing.assert_array_equal(found.update_row[:, 0], rows // 20 * 20)
    np.testing.assert_array_equal(found.update_row[:, 1], rows)


def test_a_repeated_torque_at_rest_keeps_its_update_times() -> None:
    position, torque = motion()
    rows = np.arange(len(torque))
    rest = rows >= 4000
    torque[rest], position[rest] = torque[4000], position[4000]
    found = find_repeated_torques(position, torque[rows // 20 * 20])
    assert found is not None
    np.testing.assert_array_equal(found.update_row[:, 0], rows // 20 * 20)


@pytest.mark.parametrize("steps", [20.0, 100.0, 1000.0])
def test_a_coarsely_quantised_torque_is_not_repeated(steps: float) -> None:
    position, torque = motion()
    assert find_repeated_torques(position, np.round(torque * steps / 30.0) * 30.0 / steps) is None


def test_noise_is_not_repeated() -> None:
    position, torque = motion()
    noisy = torque + np.random.default_rng(0).normal(0.0, 0.1, torque.shape)
    assert find_repeated_torques(position, noisy) is None


def test_completely_repeated_rows_are_not_repeated_torques() -> None:
    position, torque = motion()
    rows = np.arange(len(torque)) // 4 * 4
    assert find_repeated_torques(position[rows], torque[rows]) is None


def test_the_finding_names_joint_rates_and_treatment() -> None:
    position, torque = motion()
    assert repeated_torque_sentence(recording(position, torque)) == ""
    torque[:, 1] = torque[np.arange(len(torque)) // 20 * 20, 1]
    sentence = repeated_torque_sentence(recording(position, torque))
    assert "b at 25 Hz" in sentence
    assert "500 Hz" in sentence
    periodic = replace(recording(position, torque), sample_period_s=STEP_S, samples_per_period=500)
    assert repeated_torque_sentence(periodic) != sentence
