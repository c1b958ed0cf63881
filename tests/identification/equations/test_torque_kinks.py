"""Torques with a kink between two rows: the sum over the rows becomes the exact integral."""

from __future__ import annotations

import numpy as np
import pytest

from config.arrays import FloatArray
from identification.equations.torque_kinks import integrable_torque

ROWS = 60
TURN = 30.0


def motion(phi: float) -> tuple[FloatArray, FloatArray]:
    """Return a joint that brakes harder than it accelerates, and one that moves steadily."""
    since: FloatArray = np.arange(ROWS, dtype=np.float64) - (TURN + phi)
    braking, speeding = np.minimum(since, 0.0), np.maximum(since, 0.0)
    turning = -0.03 * braking**2 - 0.02 * speeding**2
    speed = -0.06 * braking - 0.04 * speeding
    other = 0.1 * np.arange(ROWS)
    return (
        np.asarray(np.stack([turning, other], axis=1), dtype=np.float64),
        np.asarray(np.stack([speed, np.full(ROWS, 0.1)], axis=1), dtype=np.float64),
    )


def torque_with_kink(phi: float) -> FloatArray:
    """Return the torques of both joints, with a kink when the first one reverses."""
    since = np.arange(ROWS) - (TURN + phi)
    after = np.maximum(since, 0.0)
    torque = 5.0 + 0.2 * since + 0.01 * since**2 + 3.0 * after - 0.4 * after**2 + 0.02 * after**3
    return np.stack([torque, torque], axis=1)


@pytest.mark.parametrize("phi", [0.0, 0.1, 0.5, 0.62, 0.99])
def test_a_kink_is_integrated_exactly(phi: float) -> None:
    torque = torque_with_kink(phi)
    missing = (integrable_torque(torque, *motion(phi)) - torque)[:, 1].sum()
    rest = 1.0 - phi
    bernoulli = (
        rest**2 - rest + 1.0 / 6.0,
        rest**3 - 1.5 * rest**2 + 0.5 * rest,
        rest**4 - 2.0 * rest**3 + rest**2 - 1.0 / 30.0,
    )
    exact = 3.0 * bernoulli[0] / 2.0 - 0.4 * bernoulli[1] / 3.0 + 0.02 * bernoulli[2] / 4.0
    assert missing == pytest.approx(exact, abs=1e-9)


def test_only_rows_next_to_the_kink_change() -> None:
    changed = integrable_torque(torque_with_kink(0.3), *motion(0.3)) != torque_with_kink(0.3)
    assert np.flatnonzero(changed[:, 1]).tolist() == [30, 31]


def test_the_reversing_joint_keeps_its_torque() -> None:
    torque = torque_with_kink(0.3)
    np.testing.assert_array_equal(integrable_torque(torque, *motion(0.3))[:, 0], torque[:, 0])


def test_without_a_reversal_nothing_changes() -> None:
    position, velocity = motion(0.3)
    position[:, 0], velocity[:, 0] = position[:, 1], velocity[:, 1]
    np.testing.assert_array_equal(
        integrable_torque(torque_with_kink(0.3), position, velocity), torque_with_kink(0.3)
    )


def test_a_long_standstill_is_not_a_quick_reversal() -> None:
    position, velocity = motion(0.3)
    velocity[25:36, 0] = 0.0
    np.testing.assert_array_equal(
        integrable_torque(torque_with_kink(0.3), position, velocity), torque_with_kink(0.3)
    )


def test_a_reversal_at_an_end_changes_nothing() -> None:
    position, velocity = motion(0.3)
    part = slice(28, 34)
    torque = torque_with_kink(0.3)[part]
    found = integrable_torque(torque, position[part], velocity[part])
    np.testing.assert_array_equal(found, torque)
