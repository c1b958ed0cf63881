"""Imports of the same rows are recognised; imports of other runs have no rows in common."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.recording.recording import Recording
from config.arrays import FloatArray
from rid_daq.runs.repeated_imports import row_hashes, rows_in_common

ROWS = 2000


def run(seed: int, step: float = 1e-6) -> FloatArray:
    """Return positions and torques of two joints, with rests, noise and a quantisation step.

    All runs have the same motion. The shape is (rows, 4).
    """
    random = np.random.default_rng(seed)
    t = 0.01 * np.arange(ROWS)
    q = np.column_stack([np.sin(0.7 * t), np.cos(1.3 * t)])
    q[300:400] = q[300]
    torque_nm = 5.0 * q + np.sign(np.gradient(q, axis=0))
    torque_nm += 0.02 * random.standard_normal(q.shape)
    return np.round(np.hstack([q, torque_nm]) / step) * step


def recording(rows: FloatArray) -> Recording:
    count = len(rows)
    return Recording(
        joint_names=("a", "b"),
        time_s=0.01 * np.arange(count, dtype=np.float64),
        position=rows[:, :2],
        torque_nm=rows[:, 2:],
        valid=np.ones(count, dtype=np.bool_),
        phase=np.zeros(count, dtype=np.uint8),
        sample_index=np.full(count, -1, dtype=np.int64),
        source="import",
    )


def in_common(one: FloatArray, other: FloatArray) -> int:
    return rows_in_common(row_hashes([recording(one)]), row_hashes([recording(other)]))


@pytest.mark.parametrize(
    ("one", "other", "rows"),
    [
        (slice(None), slice(None), ROWS),
        (slice(None), slice(500, 1500), 1000),
        (slice(500, 1500), slice(None), 1000),
        (slice(0, 1200), slice(800, None), 400),
        (slice(0, 60), slice(0, 60), 60),
        (slice(0, 1000), slice(1000, None), 0),
    ],
)
def test_rows_in_common_are_counted(one: slice, other: slice, rows: int) -> None:
    whole = run(0)
    assert in_common(whole[one], whole[other]) == rows


def test_a_row_that_was_left_out_hides_nothing() -> None:
    whole = run(0)
    assert in_common(whole, np.delete(whole, 1950, axis=0)) >= 1900


@pytest.mark.parametrize("step", [1e-6, 0.1])
@pytest.mark.parametrize("seed", range(1, 21))
def test_the_same_motion_again_is_another_run(seed: int, step: float) -> None:
    """The coarse step is five times the noise, so that many rows are equal by chance."""
    assert in_common(run(0, step), run(seed, step)) == 0


def test_parts_of_a_recording_have_the_hashes_of_the_whole() -> None:
    whole = run(0)
    parts = [recording(whole[:700]), recording(whole[700:])]
    np.testing.assert_array_equal(row_hashes(parts), row_hashes([recording(whole)]))
