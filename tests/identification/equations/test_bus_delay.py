"""Torque delays: plausible ones become part of the model, others are reported."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.processing.torque_channel import TorqueChannel
from identification.equations.bus_delay import (
    longest_delay_s,
    refused_delay_findings,
    split_implausible_delays,
)


def test_two_slow_cycles_and_two_rows_are_plausible() -> None:
    assert longest_delay_s(0.0) == pytest.approx(0.020)
    assert longest_delay_s(0.008) == pytest.approx(0.036)


def test_a_delay_of_87_ms_is_removed_and_reported() -> None:
    channel = TorqueChannel.none(2)
    late = type(channel).of_delays(np.array([0.004, -0.087]), np.array([0.001, 0.0065]))
    kept, refused_s = split_implausible_delays(late, 0.008)
    np.testing.assert_array_equal(kept.delay_s, [0.004, 0.0])
    np.testing.assert_array_equal(kept.delay_sigma_s, [0.001, 0.0])
    np.testing.assert_array_equal(refused_s, [0.0, -0.087])
    (finding,) = refused_delay_findings(("a", "b"), refused_s.tolist())
    assert "b seems to be 87 ms early" in finding


@given(st.floats(-0.2, 0.2), st.floats(1e-4, 0.05))
def test_a_delay_is_in_the_model_or_reported(delay_s: float, period_s: float) -> None:
    channel = TorqueChannel.of_delays(np.array([delay_s]), np.array([1e-4]))
    kept, refused_s = split_implausible_delays(channel, period_s)
    assert kept.delay_s[0] + refused_s[0] == delay_s
    assert abs(kept.delay_s[0]) <= longest_delay_s(period_s)
    assert len(refused_delay_findings(("a",), refused_s.tolist())) == (refused_s[0] != 0.0)
