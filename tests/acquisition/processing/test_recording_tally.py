"""The statistics of a recording that is read in parts are the same as those of the whole
recording.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition.motion.samples import Phase
from acquisition.processing.recording_tally import RecordingTally
from acquisition.recording.recording import Recording

ROWS = 400
NUMBERS = (
    *("rows", "valid_rows", "duration_s", "lost", "last_row", "last_phase"),
    *("position_min", "position_max", "speed", "torque", "following_error"),
)


@pytest.fixture
def recording() -> Recording:
    """A recording of two joints: 20 rows before the motion, and 9 rows after its last sample.

    Some answers are lost.
    """
    random = np.random.default_rng(1)
    answered = random.random((ROWS, 2)) > 0.05
    position = random.normal(size=(ROWS, 2)).cumsum(axis=0)
    index = np.minimum(np.arange(ROWS) - 20, 370)
    return Recording(
        joint_names=("a", "b"),
        time_s=0.01 * np.arange(ROWS, dtype=np.float64),
        position=position,
        torque_nm=random.normal(size=(ROWS, 2)),
        target_position=position + random.normal(size=(ROWS, 2)),
        valid=np.asarray(answered.all(axis=1)),
        answered=answered,
        phase=np.where(index < 0, Phase.APPROACH, Phase.MAIN).astype(np.uint8),
        sample_index=np.maximum(index, -1),
        source="cell",
        sample_period_s=0.01,
        samples_per_period=50,
    )


@pytest.mark.parametrize("size", [1, 7, 50, 391])
def test_statistics_of_parts_equal_those_of_the_whole(recording: Recording, size: int) -> None:
    whole = RecordingTally(recording)
    parts = RecordingTally(recording.part(slice(0, size)))
    for first in range(size, ROWS, size):
        parts.add(recording.part(slice(first, first + size)))
    for name in NUMBERS:
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name), err_msg=name)
    assert parts.cutter.periods == whole.cutter.periods == 8


def test_positions_speeds_torques_and_losses_are_those_of_the_valid_rows(
    recording: Recording,
) -> None:
    tally, good = RecordingTally(recording), recording.valid
    position = recording.position[good]
    steps = np.diff(position, axis=0) / np.diff(recording.time_s[good])[:, np.newaxis]
    np.testing.assert_array_equal(tally.position_max, position.max(axis=0))
    np.testing.assert_array_equal(tally.speed, np.abs(steps).max(axis=0))
    np.testing.assert_array_equal(tally.torque, np.abs(recording.torque_nm[good]).max(axis=0))
    moved = recording.sample_index >= 0
    for joint, lost in enumerate(tally.lost):
        answered = moved & recording.joint_valid[:, joint]
        assert lost == 371 - len(np.unique(recording.sample_index[answered]))


def end_early(recording: Recording) -> Recording:
    """Return the recording stopped after 3 periods of 50 rows: the motion skips periods 4 to 6."""
    whole = replace(
        recording, answered=np.ones((ROWS, 2), dtype=np.bool_), valid=np.ones(ROWS, dtype=np.bool_)
    )
    kept = np.concatenate([np.arange(170), np.arange(320, ROWS)])
    early = Recording(
        **{
            name: values[kept] if isinstance(values, np.ndarray) and len(values) == ROWS else values
            for name, values in vars(whole).items()
        }
    )
    return replace(early, time_s=0.01 * np.arange(len(kept), dtype=np.float64))


@pytest.mark.parametrize("size", [7, 170, 250])
def test_rows_skipped_by_an_early_end_are_not_lost(recording: Recording, size: int) -> None:
    early = end_early(recording)
    tally = RecordingTally(early.part(slice(0, size)))
    for first in range(size, len(early), size):
        tally.add(early.part(slice(first, first + size)))
    assert tally.lost == (0, 0)
    assert tally.motion_rows == 371 - 150
    gap = replace(early, time_s=early.time_s + np.where(np.arange(len(early)) < 170, 0.0, 1.5))
    assert RecordingTally(gap).lost == (150, 150)  # the time stamps show a gap of 150 rows


def test_without_set_points_there_is_no_following_error(recording: Recording) -> None:
    assert RecordingTally(replace(recording, target_position=None)).following_error is None


def test_before_the_motion_nothing_is_counted(recording: Recording) -> None:
    tally = RecordingTally(recording.part(slice(0, 20)))
    assert (tally.last_row, tally.lost, tally.cutter.periods) == (-1, (0, 0), 0)
