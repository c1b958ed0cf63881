"""Count the rows of our own recordings in which no drive had a new value.

The recording is read in parts.
"""

from __future__ import annotations

import numpy as np

from acquisition.clock.repeat_counter import RepeatCounter
from acquisition.motion.samples import Phase
from acquisition.recording.recording import Recording
from config.arrays import FloatArray
from tests.builders.logged_arm import LoggedArm, row_times


def recording_at(true_s: FloatArray) -> Recording:
    samples = LoggedArm.of(1).at(true_s, row_times(len(true_s)))
    rows = len(true_s)
    return Recording(
        joint_names=("a", "b", "c", "d"),
        time_s=samples.time_s,
        position=samples.position,
        torque_nm=samples.torque,
        valid=np.ones(rows, dtype=np.bool_),
        phase=np.full(rows, Phase.MAIN, dtype=np.uint8),
        sample_index=np.arange(rows),
        source="cell",
    )


def test_a_row_that_no_drive_updated_is_counted_in_each_part() -> None:
    true_s = row_times()
    true_s[7::50] = true_s[6::50]
    whole, counter = recording_at(true_s), RepeatCounter()
    for first in range(0, 2500, 500):
        counter.add(whole.part(slice(first, first + 500)))
    assert counter.report().repeated_rows == 50
    assert counter.report().rows == 2500
    (note,) = counter.notes()
    assert "50 of 2500 rows (2.0 %)" in note


def test_a_sound_recording_has_no_repeats() -> None:
    counter = RepeatCounter()
    counter.add(recording_at(row_times()))
    assert counter.report().repeated_rows == 0
    assert counter.notes() == ()
