"""Two recordings of one motion are aligned in time before they are subtracted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.processing.smoothing import SmoothedSignals
from config.errors import EstimationError
from identification.payload.same_motion import torque_difference
from tests.builders.raised_codes import raises_code

STEP_S = 0.01


def recording_with_late_stamps(
    late_s: float, torque_nm: float, *, size: float = 1.0
) -> SmoothedSignals:
    """Return 20 s of two joints: stamps are `late_s` late, torques have the offset `torque_nm`."""
    time_s = np.arange(0.0, 20.0, STEP_S)
    phase = np.outer(time_s - late_s, [1.1, 1.7])
    wave = size * (np.sin(phase) + 0.3 * np.sin(2.3 * phase))
    return SmoothedSignals(
        joint_names=("one", "two"),
        time_s=time_s,
        position=wave,
        velocity=np.gradient(wave, STEP_S, axis=0),
        acceleration=np.zeros_like(wave),
        torque_nm=wave + torque_nm,
        segment=np.zeros(len(time_s), dtype=np.int64),
        sample_period_s=STEP_S,
        cutoff_hz=10.0,
    )


@settings(max_examples=20)
@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_the_difference_is_the_payloads_torque(first_s: float, second_s: float) -> None:
    found = torque_difference(
        recording_with_late_stamps(first_s, 5.0), recording_with_late_stamps(second_s, 2.0)
    )
    assert len(found) * STEP_S > 13.9
    np.testing.assert_allclose(found.torque_nm, 3.0, atol=1e-3)


def test_another_motion_is_refused_with_the_joint() -> None:
    with raises_code(EstimationError, "RID-PAYLOAD-PROCEDURE", "0.0745 rad", "at two"):
        torque_difference(
            recording_with_late_stamps(0.0, 0.0), recording_with_late_stamps(0.0, 0.0, size=1.1)
        )


def test_a_recording_with_gaps_is_refused() -> None:
    whole = recording_with_late_stamps(0.0, 0.0)
    torn = replace(whole, segment=np.repeat([0, 1], len(whole) // 2))
    with raises_code(EstimationError, "RID-PAYLOAD-PROCEDURE", "run without", "gaps"):
        torque_difference(whole, torn)


def test_motions_that_hardly_overlap_are_refused() -> None:
    first = recording_with_late_stamps(0.0, 0.0)
    rows = slice(0, 300)
    names = ("time_s", "position", "velocity", "acceleration", "torque_nm", "segment")
    short = replace(first, **{name: getattr(first, name)[rows] for name in names})
    with raises_code(EstimationError, "RID-PAYLOAD-PROCEDURE", "five seconds"):
        torque_difference(first, short)
