from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.signals.resampling import LONGEST_FILLED_GAP, PASS_ERROR, resample
from config.errors import DataQualityError
from tests.builders.raised_codes import raises_code

CYCLE_S = 0.008
AT = 2.0003 + CYCLE_S * np.arange(1000, dtype=np.float64)


def rows(rate_hz: float) -> NDArray[np.float64]:
    return 1.00005 * np.arange(0.0, 12.0, 1.0 / rate_hz)


def all_valid(times: NDArray[np.float64]) -> NDArray[np.bool_]:
    return np.ones((len(times), 1), dtype=np.bool_)


def sine(frequency_hz: float, times: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.sin(2.0 * np.pi * frequency_hz * times)[:, np.newaxis]


@pytest.mark.parametrize("rate_hz", [158.0, 960.0, 1000.0])
@pytest.mark.parametrize("frequency_hz", [0.1, 5.0, 20.0, 50.0])
def test_frequencies_below_both_nyquist_frequencies_pass(
    rate_hz: float, frequency_hz: float
) -> None:
    times = rows(rate_hz)
    found, good = resample(times, sine(frequency_hz, times), all_valid(times), AT, 1.0 / CYCLE_S)
    assert good.all()
    np.testing.assert_allclose(found, sine(frequency_hz, AT), atol=PASS_ERROR)


@pytest.mark.parametrize("frequency_hz", [76.0, 115.0, 124.0, 135.0, 400.0])
def test_frequencies_that_would_alias_are_removed(frequency_hz: float) -> None:
    times = rows(960.0)
    found, _ = resample(times, sine(frequency_hz, times), all_valid(times), AT, 1.0 / CYCLE_S)
    assert np.abs(found).max() < PASS_ERROR


def test_more_rows_than_samples_reduce_noise() -> None:
    times = rows(1000.0)
    noise = np.random.default_rng(0).standard_normal((len(times), 1))
    found, _ = resample(times, noise, all_valid(times), AT, 1.0 / CYCLE_S)
    assert found.std() == pytest.approx(np.sqrt(125.0 / 1000.0), rel=0.1)


def test_short_gaps_are_filled() -> None:
    times = rows(960.0)
    received = np.ones(len(times), dtype=bool)
    received[[3000, 4000, 4001, 5000, 5001, 5002]] = False
    found, good = resample(
        times[received], sine(5.0, times[received]), all_valid(times[received]), AT, 1.0 / CYCLE_S
    )
    assert good.all()
    np.testing.assert_allclose(found, sine(5.0, AT), atol=3e-4)


def test_long_gaps_stay_empty() -> None:
    times = rows(960.0)
    received = np.ones(len(times), dtype=bool)
    received[4000 : 4001 + LONGEST_FILLED_GAP] = False
    _, good = resample(
        times[received], sine(5.0, times[received]), all_valid(times[received]), AT, 1.0 / CYCLE_S
    )
    bad_s = AT[~good[:, 0]]
    assert bad_s.min() == pytest.approx(times[4000] - 0.1, abs=0.02)
    assert bad_s.max() == pytest.approx(times[4003] + 0.1, abs=0.02)


def test_no_overloaded_value_enters_a_sample() -> None:
    times = rows(960.0)
    values, valid = sine(5.0, times), all_valid(times)
    values[5000:5003], valid[5000:5003] = 1e9, False
    found, good = resample(times, values, valid, AT, 1.0 / CYCLE_S)
    assert not good.all()
    np.testing.assert_allclose(found[good], sine(5.0, AT)[good], atol=PASS_ERROR)
    assert (found[~good] == 0.0).all()


def test_no_sample_is_extrapolated_beyond_the_ends() -> None:
    times = rows(960.0)
    _, good = resample(times, sine(5.0, times), all_valid(times), AT - 2.5, 1.0 / CYCLE_S)
    assert not good[AT - 2.5 < 0.1].any()
    assert good[AT - 2.5 > 0.11].all()


@pytest.mark.parametrize(
    "times", [np.zeros(1), np.zeros(10), np.array([0.0, 1.0, 2.4, 3.0, 4.6, 5.0])]
)
def test_irregular_times_are_refused(times: NDArray[np.float64]) -> None:
    with raises_code(DataQualityError, "RID-PLATE-CLOCK"):
        resample(times, np.zeros((len(times), 1)), all_valid(times), AT, 125.0)
