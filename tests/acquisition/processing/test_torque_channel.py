"""Torque channel: delay and filter agree with their equations.

A channel for other joints is refused.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import bilinear, butter, lfilter, sosfiltfilt

from acquisition.processing.torque_channel import TorqueChannel
from config.errors import EstimationError

STEP_S = 0.001
TIME_S = STEP_S * np.arange(6000)
TORQUE = np.stack([np.sin(3.0 * TIME_S) + np.sign(np.sin(5.0 * TIME_S)), np.cos(2.0 * TIME_S)], 1)
INNER = slice(500, -500)


def test_a_channel_without_values_changes_nothing() -> None:
    channel = TorqueChannel.none(2)
    assert channel.kind == "none"
    np.testing.assert_allclose(channel.through(TORQUE, STEP_S), TORQUE, atol=1e-12)


def test_a_delay_can_be_a_fraction_of_a_sample() -> None:
    channel = TorqueChannel.of_delays(np.array([0.0, 0.0037]), np.zeros(2))
    late = channel.through(TORQUE, STEP_S)
    shifted = CubicSpline(TIME_S, TORQUE[:, 1])(TIME_S[INNER] - 0.0037)
    np.testing.assert_allclose(late[INNER, 1], shifted, atol=1e-4)
    np.testing.assert_allclose(late[:, 0], TORQUE[:, 0], atol=1e-12)
    assert channel.kind == "delay"
    assert not channel.filters


def test_a_lag_is_a_first_order_filter() -> None:
    channel = replace(TorqueChannel.none(2), lag_s=np.full(2, 0.03))
    assert channel.kind == "lag"
    b, a = bilinear([1.0], [0.03, 1.0], 1.0 / STEP_S)
    expected = lfilter(b, a, TORQUE, axis=0)
    np.testing.assert_allclose(channel.through(TORQUE, STEP_S)[INNER], expected[INNER], atol=0.04)


@pytest.mark.parametrize("order", [1, 2, 4])
def test_a_zero_phase_filter_is_a_forward_backward_butterworth_filter(order: int) -> None:
    channel = replace(TorqueChannel.none(2), width_s=np.full(2, 0.03), order=order)
    assert channel.kind == "zero-phase"
    expected = sosfiltfilt(
        butter(order, 0.5 / np.pi / 0.03, fs=1.0 / STEP_S, output="sos"), TORQUE, axis=0
    )
    np.testing.assert_allclose(channel.through(TORQUE, STEP_S)[INNER], expected[INNER], atol=0.04)


def test_each_joints_columns_pass_its_own_channel() -> None:
    channel = replace(TorqueChannel.none(2), lag_s=np.array([0.0, 0.02]))
    columns = np.repeat(TORQUE[:, np.newaxis, 1], 2, axis=1)
    through = channel.through(TORQUE, STEP_S)
    np.testing.assert_allclose(channel.of_joint(columns, 1, STEP_S)[:, 1], through[:, 1])
    assert channel.of_joint(columns, 0, STEP_S) is columns


def test_the_spread_of_an_event_is_reported() -> None:
    channel = TorqueChannel.of_delays(np.array([0.004, -0.002]), np.zeros(2))
    np.testing.assert_allclose(channel.after_s, [0.004, 0.0])
    np.testing.assert_allclose(channel.before_s, [0.0, 0.002])


def test_a_channel_for_other_joints_is_refused() -> None:
    with pytest.raises(EstimationError):
        TorqueChannel.of_delays(np.zeros(3), np.zeros(2))
