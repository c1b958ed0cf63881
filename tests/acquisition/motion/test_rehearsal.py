"""Rehearsal: the path of the motion, once, at a fraction of its speed."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.motion.limits import verify_limits
from acquisition.motion.rehearsal import rehearsal
from acquisition.motion.samples import MotionSamples
from config.errors import ConfigError
from config.robot.robot import RobotDescription
from tests.builders.raised_codes import raises_code


def test_a_rehearsal_follows_the_same_path_at_the_reduced_speed(
    motion: MotionSamples, robot: RobotDescription
) -> None:
    slow = rehearsal(motion, 4.0)
    verify_limits(slow, robot)
    np.testing.assert_allclose(slow.position[0], motion.position[0], atol=1e-12)
    np.testing.assert_allclose(slow.position[-1], motion.position[-1], atol=1e-12)
    fastest, slowest = np.abs(motion.velocity).max(axis=0), np.abs(slow.velocity).max(axis=0)
    np.testing.assert_allclose(slowest, fastest / 4.0, rtol=0.01)
    for low, high, path in zip(
        motion.position.min(axis=0), motion.position.max(axis=0), slow.position.T, strict=True
    ):
        assert low - 1e-3 < path.min() < low + 1e-3
        assert high - 1e-3 < path.max() < high + 1e-3
    step = np.diff(slow.position, axis=0) / slow.sample_period_s
    assert np.abs(step).max() <= np.abs(slow.velocity).max() * 1.01, (
        "no jump at the removed periods"
    )
    assert slow.samples_per_period is None


def test_a_rehearsal_has_one_period_of_a_periodic_motion(motion: MotionSamples) -> None:
    assert motion.samples_per_period is not None
    left_out = 2 * motion.samples_per_period  # one transient and two main periods
    assert len(rehearsal(motion, 1.0)) == len(motion) - left_out


@pytest.mark.parametrize("slower", [0.5, float("nan"), float("inf")])
def test_a_rehearsal_faster_than_the_motion_is_refused(
    motion: MotionSamples, slower: float
) -> None:
    with raises_code(ConfigError, "RID-OPTION-RANGE", "slower"):
        rehearsal(motion, slower)
