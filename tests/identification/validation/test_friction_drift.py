"""Friction drift from period to period, detected in a simulated recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition.motion.samples import Phase
from acquisition.recording.recording import Recording
from identification.validation.friction_drift import friction_drift

PERIOD, PERIODS = 500, 10


@pytest.fixture
def recording() -> Recording:
    """Two axes with 20 N m of friction; the friction of axis 2 falls by a tenth during the run."""
    rows = PERIOD * PERIODS
    random = np.random.default_rng(0)
    angle = 2.0 * np.pi * np.arange(rows) / PERIOD
    position = np.column_stack([np.sin(angle), np.sin(angle + 1.0)])
    speed = np.column_stack([np.cos(angle), np.cos(angle + 1.0)])
    size = 20.0 * np.column_stack([np.ones(rows), 1.0 - 0.1 * np.arange(rows) / rows])
    torque = size * np.sign(speed) + 50.0 * position + random.normal(size=(rows, 2))
    return Recording(
        joint_names=("a", "b"),
        time_s=0.01 * np.arange(rows, dtype=np.float64),
        position=position,
        torque_nm=torque,
        valid=np.ones(rows, bool),
        phase=np.full(rows, Phase.MAIN, np.uint8),
        sample_index=np.arange(rows),
        target_position=position,
        sample_period_s=0.01,
        samples_per_period=PERIOD,
        torque_filter=None,
        source="cell",
    )


def test_the_warming_axis_is_detected(recording: Recording) -> None:
    steady, warming = friction_drift([recording])
    assert not steady.significant
    assert warming.significant
    assert warming.share == pytest.approx(-0.09, abs=0.01)  # between the middles of the periods
    assert warming.first == pytest.approx(20.0, abs=0.5)
    assert "b's friction fell by 8.9" in warming.sentence
    assert "still warming up" in warming.sentence
    cooling = replace(warming, first=warming.last, last=warming.first)
    assert "b's friction rose by 8.9" in cooling.sentence
    assert "probably cooled down" in cooling.sentence


def test_a_period_with_missing_rows_is_ignored(recording: Recording) -> None:
    keep = np.ones(len(recording.time_s), bool)
    keep[PERIOD + 10 : PERIOD + 200] = False
    rows = {
        name: getattr(recording, name)[keep]
        for name in (
            "time_s",
            "position",
            "torque_nm",
            "valid",
            "phase",
            "sample_index",
            "target_position",
        )
    }
    assert not friction_drift([replace(recording, **rows)])[0].significant


def test_too_few_periods_give_no_result(recording: Recording) -> None:
    assert friction_drift([replace(recording, samples_per_period=None)]) == ()
    assert friction_drift([replace(recording, samples_per_period=2 * 900)]) == ()
