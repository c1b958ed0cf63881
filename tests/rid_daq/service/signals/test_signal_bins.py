"""Reduction of a motion's rows to bins: extremes are kept, and gaps stay gaps."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray

from acquisition.journal.cycle_row import row_dtype
from rid_daq.service.signals.signal_bins import BIN_S, LANES, SignalBinner, SignalBins, lanes_of

CYCLE_S = 0.008
BEGIN_S = 1.7e9
JOINTS = 2


def rows_of(time_s: ArrayLike, seed: int = 1) -> NDArray[Any]:
    """Return rows with random values at given times."""
    random = np.random.default_rng(seed)
    times = np.asarray(time_s)
    count = len(times)
    rows = np.zeros(count, dtype=row_dtype(JOINTS))
    rows["time_s"] = times
    for name in ("position", "target_position", "torque_nm"):
        rows[name] = random.normal(size=(count, JOINTS))
    rows["exchange_s"] = random.uniform(0.0, CYCLE_S, count)
    rows["valid"] = 1
    return rows


def binned(rows: NDArray[Any], parts: Sequence[int] = ()) -> SignalBins:
    """Return all bins of rows that arrive in parts."""
    binner = SignalBinner(JOINTS, CYCLE_S)
    found = [
        binner.add(part, part["time_s"] + BEGIN_S) for part in np.split(rows, sorted(set(parts)))
    ]
    found.append(binner.finish())
    return SignalBins(
        *(
            np.concatenate([getattr(each, name) for each in found])
            for name in SignalBins.__match_args__
        )
    )


def lane(bins: SignalBins, name: str) -> NDArray[np.float32]:
    begin = 2 + JOINTS * LANES.index(name)
    return bins.values[:, begin : begin + JOINTS]


steps = st.lists(
    st.one_of(st.just(CYCLE_S), st.sampled_from([2 * CYCLE_S, 0.07, 0.5])), min_size=1, max_size=120
)


@settings(max_examples=60, deadline=None)
@given(steps, st.lists(st.integers(0, 120), max_size=6), st.integers(0, 99))
def test_each_bin_keeps_minimum_and_maximum_and_no_bin_contains_a_gap(
    steps_s: list[float], parts: list[int], seed: int
) -> None:
    rows = rows_of(np.cumsum(steps_s), seed)
    bins = binned(rows, [each for each in parts if each < len(rows)])
    wall_s = rows["time_s"] + BEGIN_S
    ends = np.searchsorted(wall_s, bins.end_s, side="right")
    assert ends[-1] == len(rows)
    assert bool(bins.after_gap[0])
    for i, (begin, end) in enumerate(pairwise([0, *ends.tolist()])):
        inside = rows[begin:end]
        assert len({int(each) for each in np.floor(wall_s[begin:end] / BIN_S)}) == 1
        assert np.all(np.diff(inside["time_s"]) <= BIN_S)
        for name, values in (
            ("position", inside["position"]),
            ("torque", inside["torque_nm"]),
            ("following_error", inside["target_position"] - inside["position"]),
        ):
            np.testing.assert_allclose(lane(bins, f"{name}_low")[i], values.min(axis=0), rtol=1e-6)
            np.testing.assert_allclose(lane(bins, f"{name}_high")[i], values.max(axis=0), rtol=1e-6)
        if i:
            is_gap = rows["time_s"][begin] - rows["time_s"][begin - 1] > BIN_S
            assert bins.after_gap[i] == is_gap


@settings(max_examples=20, deadline=None)
@given(st.lists(st.integers(0, 100), max_size=8))
def test_the_bins_do_not_depend_on_the_parts_in_which_rows_arrive(parts: list[int]) -> None:
    rows = rows_of(np.arange(100) * CYCLE_S)
    whole, split = binned(rows), binned(rows, [each for each in parts if each < 100])
    for name in SignalBins.__match_args__:
        np.testing.assert_array_equal(getattr(split, name), getattr(whole, name))


def test_values_of_a_silent_drive_are_left_out() -> None:
    rows = rows_of(np.arange(20) * CYCLE_S)
    rows["valid"][:, 1] = 0
    bins = binned(rows)
    for name in ("position_low", "torque_high", "velocity_low", "following_error_high"):
        assert np.isnan(lane(bins, name)[:, 1]).all()
    assert np.isfinite(lane(bins, "position_low")[:, 0]).all()


def test_the_speed_is_the_slope_of_the_position_and_not_that_over_a_gap() -> None:
    time_s = np.append(np.arange(100) * CYCLE_S, 2.0 + np.arange(100) * CYCLE_S)
    rows = rows_of(time_s)
    rows["position"] = time_s[:, np.newaxis] * (0.5, -2.0) + 5.0 * (time_s > 1.0)[:, np.newaxis]
    bins = binned(rows)
    low, high = lane(bins, "velocity_low"), lane(bins, "velocity_high")
    known = np.isfinite(low[:, 0])
    assert bins.after_gap.sum() == 2
    assert known.sum() >= len(bins) - 2
    np.testing.assert_allclose(low[known], [(0.5, -2.0)] * known.sum(), rtol=1e-4)
    np.testing.assert_allclose(high[known], low[known], rtol=1e-4)


def test_bins_have_the_present_temperature_and_the_share_of_the_cycle() -> None:
    binner = SignalBinner(JOINTS, CYCLE_S)
    rows = rows_of(np.arange(20) * CYCLE_S)
    rows["exchange_s"] = 0.25 * CYCLE_S
    bins = binner.add(rows, rows["time_s"] + BEGIN_S, [41.0, 52.5])
    np.testing.assert_allclose(lane(bins, "temperature"), [(41.0, 52.5)] * len(bins))
    np.testing.assert_allclose(bins.values[:, :2], 0.25)
    assert bins.values.shape == (3, lanes_of(JOINTS))


@pytest.mark.parametrize("cycle_s", [0.001, 0.02])
def test_the_number_of_bins_does_not_depend_on_the_cycle_time(cycle_s: float) -> None:
    rows = rows_of(np.arange(round(10.0 / cycle_s)) * cycle_s)
    binner = SignalBinner(JOINTS, cycle_s)
    count = len(binner.add(rows, rows["time_s"] + BEGIN_S)) + len(binner.finish())
    assert count == pytest.approx(10.0 / BIN_S, abs=1)
