"""Torque delays: plausible ones become part of the model, others are reported."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.processing.torque_channel import TorqueChannel
from identification.equations.bus_delay import (
    longest_delay_s,
    split_implausible_channel,
)


def test_two_slow_cycles_and_two_rows_are_plausible() -> None:
    assert longest_delay_s(0.0) == pytest.approx(0.020)
    assert longest_delay_s(0.008) == pytest.approx(0.036)


def test_a_delay_of_87_ms_is_removed_and_reported() -> None:
    channel = TorqueChannel.none(2)
    late = type(channel).of_delays(np.array([0.004, -0.087]), np.array([0.001, 0.0065]))
    kept, refused = split_implausible_channel(late, 0.008)
    np.testing.assert_array_equal(kept.delay_s, [0.004, 0.0])
    np.testing.assert_array_equal(kept.delay_sigma_s, [0.001, 0.0])
    assert (refused.delay_s, refused.is_bound) == ((0.0, -0.087), (False, False))
    (finding,) = refused.findings(("a", "b"))
    assert "b seems to be 87 ms early" in finding


def test_a_delay_at_the_end_of_its_range_is_refused_as_a_bound() -> None:
    late = TorqueChannel.of_delays(np.array([0.05, 0.004]), np.array([0.05, 0.001]))
    kept, refused = split_implausible_channel(late, 0.04)  # a bus would explain 100 ms
    assert kept.delay_s.tolist() == [0.0, 0.004]
    assert (refused.delay_s, refused.is_bound) == ((0.05, 0.0), (True, False))
    (finding,) = refused.findings(("a", "b"))
    assert "50 ms" in finding


def test_a_filter_at_the_end_of_its_range_is_refused_as_a_bound() -> None:
    lag_s = np.array([0.08, 0.02])
    slow = replace(TorqueChannel.none(2), lag_s=lag_s, lag_sigma_s=np.array([0.08, 1e-4]))
    kept, refused = split_implausible_channel(slow, 0.004)
    assert kept.lag_s.tolist() == [0.0, 0.02]
    assert refused.filter_s == (0.08, 0.0)
    assert ["2 Hz" in finding for finding in refused.findings(("a", "b"))] == [True]


@given(st.floats(-0.2, 0.2), st.floats(1e-4, 0.05))
def test_a_delay_is_in_the_model_or_reported(delay_s: float, period_s: float) -> None:
    channel = TorqueChannel.of_delays(np.array([delay_s]), np.array([0.2 * abs(delay_s)]))
    kept, refused = split_implausible_channel(channel, period_s)
    assert kept.delay_s[0] + refused.delay_s[0] == delay_s
    assert abs(kept.delay_s[0]) <= longest_delay_s(period_s)
    assert len(refused.findings(("a",))) == (refused.delay_s[0] != 0.0) == bool(refused)
