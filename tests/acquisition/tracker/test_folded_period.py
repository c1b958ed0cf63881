"""The mean period of a motion is computed from rows at arbitrary times, with gaps and outliers."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.tracker.folded_period import fold_period
from config.arrays import FloatArray
from config.errors import DataQualityError
from tests.builders.raised_codes import raises_code

PERIOD_S = 5.0
NOISE = 1e-3


def signal(time_s: FloatArray) -> FloatArray:
    """Return two channels that contain only a mean and the harmonics 1 and 7."""
    turn = 2.0 * np.pi * time_s / PERIOD_S
    return np.column_stack([2.0 + np.cos(turn) - 0.4 * np.sin(7.0 * turn), np.sin(turn)])


def rows(rate_hz: float, duration_s: float = 40.0) -> tuple[FloatArray, FloatArray]:
    """Return times with a gap, and the noisy signal."""
    random = np.random.default_rng(0)
    time_s = np.arange(0.0, duration_s, 1.0 / rate_hz)
    time_s = time_s[(time_s < 11.0) | (time_s > 13.5)]
    return time_s, signal(time_s) + NOISE * random.normal(size=(len(time_s), 2))


@pytest.mark.parametrize("rate_hz", [1000.0, 97.3, 11.0])
def test_the_bins_are_those_of_the_signal(rate_hz: float) -> None:
    time_s, values = rows(rate_hz)
    found = fold_period(time_s, values, PERIOD_S, 20)
    wanted = np.zeros((len(found.bins), 2), dtype=complex)
    wanted[0, 0], wanted[1, 0], wanted[7, 0], wanted[1, 1] = 2.0, 0.5, 0.2j, -0.5j
    expected = NOISE / np.sqrt(2.0 * len(time_s))
    assert found.sigma == pytest.approx(expected, rel=0.2)
    assert np.abs(found.bins[1:] - wanted[1:]).max() < 6.0 * expected


def test_the_rate_of_the_clock_is_corrected() -> None:
    time_s, values = rows(200.0)
    exact = fold_period(time_s, values, PERIOD_S, 20)
    found = fold_period(20.0 + (time_s - 20.0) * (1.0 + 2e-4), values, PERIOD_S, 20)
    # the middle of the correction is not that of the error, which leaves a delay
    assert np.abs(found.bins) == pytest.approx(np.abs(exact.bins), abs=2e-5)


def test_a_spike_has_no_effect() -> None:
    time_s, values = rows(200.0)
    clean = fold_period(time_s, values, PERIOD_S, 20)
    values[100] += 0.5
    spiked = fold_period(time_s, values, PERIOD_S, 20)
    assert np.abs(spiked.bins - clean.bins).max() < NOISE / np.sqrt(len(time_s))


def test_gaps_of_all_periods_together_limit_the_harmonics() -> None:
    time_s, values = rows(200.0)
    folded = time_s % PERIOD_S
    seen = (folded < 2.0) | (folded > 2.2)
    found = fold_period(time_s[seen], values[seen], PERIOD_S, 20)
    assert len(found.bins) - 1 == 9


def test_a_part_of_a_period_is_refused() -> None:
    time_s, values = rows(200.0)
    with raises_code(DataQualityError, "RID-TRACKER-RATE"):
        fold_period(time_s[:400], values[:400], PERIOD_S, 20)
