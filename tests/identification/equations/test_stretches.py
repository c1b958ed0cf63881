"""Long recordings are compared with richer models in evenly spaced stretches."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.recording.recording import Recording
from identification.equations.stretches import STRETCH_S, smoothed_stretches, stretches

STEP_S = 0.1


def recording(seconds: float) -> Recording:
    rows = round(seconds / STEP_S)
    time_s = np.asarray(5.0 + STEP_S * np.arange(rows), dtype=np.float64)
    return Recording(
        joint_names=("a",),
        time_s=time_s,
        position=np.zeros((rows, 1)),
        torque_nm=np.zeros((rows, 1)),
        velocity_command=None,
        valid=np.ones(rows, dtype=bool),
        phase=np.zeros(rows, dtype=np.uint8),
        sample_index=np.arange(rows),
        source="import",
    )


def test_stretches_are_spread_over_a_long_recording() -> None:
    parts = stretches(recording(2000.0), 0.15)
    assert len(parts) == 10
    for number, part in enumerate(parts):
        assert part.time_s[0] == pytest.approx(5.0 + 200.0 * number, abs=2.0 * STEP_S)
        assert part.time_s[-1] - part.time_s[0] == pytest.approx(STRETCH_S, abs=2.0 * STEP_S)


def test_a_short_recording_is_used_as_it_is() -> None:
    whole = recording(100.0)
    assert stretches(whole, 1.0) == [whole]
    assert stretches(whole, 0.95) == [whole]


def test_stretches_in_a_gap_are_left_out() -> None:
    whole = recording(2000.0)
    since_s = whole.time_s - whole.time_s[0]
    sparse = np.isin(since_s.round(3), (505.0, 510.0, 515.0))
    cut = whole.part((since_s < 400.0) | sparse | (since_s > 600.0))
    [signals] = smoothed_stretches([cut], 1.0)
    assert [round(each.time_s[0]) for each in signals] == [7, 1007, 1507]
