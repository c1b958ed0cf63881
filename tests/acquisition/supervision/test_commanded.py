"""Limits apply to the sum of a motion and its feedforward, as it is sent to the drives.

A feedforward within the speed limits of every row can still command any acceleration and position.
Therefore the total command is compared with the limits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.motion.samples import MotionSamples
from acquisition.supervision.commanded import commanded_motion, verify_command
from acquisition.supervision.held_positions import PLAUSIBLE_FACTOR
from acquisition.task.position_loop import PositionLoop
from config.arrays import FloatArray
from config.errors import LimitError
from config.load import load_cell
from tests.builders.raised_codes import raises_code

CELL = load_cell("ir361")
LIMITS = [joint.limits for joint in CELL.robot.joints]
T = CELL.config.cycle_time_s
GAIN = CELL.config.position_gain_per_s
MARGIN = 1.0 + CELL.config.supervision.limit_margin_fraction

pytestmark = pytest.mark.promise("sum-verified")


def motion(periods: int = 3, offset: float = 0.0) -> MotionSamples:
    """Return a motion of all joints by 0.1 rad, with periods of 2 s."""
    joints = tuple(
        FourierJoint(
            joint=name, offset=offset if name == "axis1" else 0.1, sine=(0.1,), cosine=(0.0,)
        )
        for name in CELL.robot.joint_names
    )
    fourier = FourierMotion(
        kind="fourier", robot="ir361", period_s=2.0, periods=periods, ramp_s=1.0, joints=joints
    )
    return fourier.plan(CELL.robot, T).whole()


def added(samples: MotionSamples, more: Callable[[FloatArray], FloatArray]) -> MotionSamples:
    """Return the motion with a feedforward: its velocity, and for axis1 plus `more(row)` rad/s."""
    ahead = samples.velocity.copy()
    ahead[:, 0] += more(np.arange(len(samples), dtype=float))
    return replace(samples, feedforward=ahead)


def refusal(samples: MotionSamples, *names: str) -> str:
    with raises_code(LimitError, "RID-MOTION-COMMAND", *names) as caught:
        verify_command(samples, CELL.config, CELL.robot)
    return str(caught.value)


def window(rows: FloatArray, count: int) -> FloatArray:
    """Return a factor for each row, which rises smoothly from 0 to 1 and falls back to 0."""
    return np.asarray(np.sin(np.pi * rows / (count - 1)) ** 2)


def test_the_commands_are_those_of_the_position_loop_with_ideal_drives() -> None:
    samples = motion()
    samples = added(samples, lambda k: 0.2 * window(k, len(samples)) * np.sin(0.3 * k))
    assert samples.feedforward is not None
    driven = commanded_motion(samples, GAIN)
    loop = PositionLoop.of_cell(CELL.config, CELL.robot)
    deviation = np.zeros(3)
    for k in range(len(samples)):
        at = samples.position[k] + deviation
        command = loop.velocity_command(
            samples.position[k].tolist(), samples.feedforward[k].tolist(), at.tolist()
        )
        np.testing.assert_allclose(driven.position[k], at, atol=1e-12)
        np.testing.assert_allclose(driven.velocity[k], command, atol=1e-12)
        deviation = deviation + T * (np.array(command) - samples.velocity[k])


def test_a_motion_without_feedforward_is_commanded_as_planned() -> None:
    samples = motion()
    assert commanded_motion(samples, GAIN) is samples
    verify_command(samples, CELL.config, CELL.robot)


def test_a_small_smooth_feedforward_is_accepted() -> None:
    samples = motion()
    verify_command(
        added(samples, lambda k: 0.1 * window(k, len(samples)) * np.sin(0.05 * k)),
        CELL.config,
        CELL.robot,
    )


@pytest.mark.parametrize("share", [0.05, 0.3, 0.999])
def test_a_feedforward_that_alternates_in_every_cycle_is_refused(share: float) -> None:
    samples = motion()
    ahead = np.zeros_like(samples.velocity)
    ahead[:, 0] = share * LIMITS[0].velocity * (-1.0) ** np.arange(len(samples))
    words = refusal(replace(samples, feedforward=ahead))
    assert "acceleration of joint 'axis1' reaches" in words
    assert f"its limit is {PLAUSIBLE_FACTOR * LIMITS[0].acceleration:.6g} rad/s^2" in words.replace(
        "-", ""
    )


def test_a_feedforward_that_moves_a_joint_beyond_its_position_limit_is_refused() -> None:
    samples = motion(offset=LIMITS[0].position_max - 0.101)
    words = refusal(added(samples, lambda k: 0.6 * window(k, len(samples))))
    assert "position of joint 'axis1' reaches" in words
    assert f"its limit is {LIMITS[0].position_max:.6g} rad" in words


def test_a_command_beyond_the_speed_limit_is_refused() -> None:
    samples = motion()
    most = MARGIN * LIMITS[0].velocity

    def fast(k: FloatArray) -> FloatArray:
        # too fast for the position loop to compensate
        return np.asarray(1.05 * most * window(k, len(samples)) * np.sin(0.4 * k))

    refusal(added(samples, fast), "velocity of joint", "'axis1'")


@pytest.mark.parametrize("row", [0, -1])
def test_a_feedforward_that_does_not_start_and_end_at_zero_is_refused(row: int) -> None:
    samples = motion()
    ahead = samples.velocity.copy()
    ahead[row, 1] = 2.0 * LIMITS[1].acceleration * T
    refusal(replace(samples, feedforward=ahead), "'axis2'")


def test_a_step_between_a_period_and_the_run_out_is_refused_if_periods_can_be_skipped() -> None:
    """The complete feedforward is smooth; it has a step if periods are skipped."""
    samples = motion(periods=4)
    rows = samples.samples_per_period
    assert rows is not None
    ends = sorted(samples.period_ends)

    def swelling(k: FloatArray) -> FloatArray:
        # increases until the end of the first period and is zero at the end of the last
        return np.asarray(0.3 * np.exp(-0.5 * ((k - ends[0]) / 60.0) ** 2))

    words = refusal(added(samples, swelling))
    assert "change of the feedforward of joint 'axis1' reaches" in words
    assert f"(row {ends[0]})" in words


def test_a_repeated_period_is_checked_like_a_stored_one() -> None:
    samples = motion()
    rows = samples.samples_per_period
    assert rows is not None
    ahead = samples.velocity.copy()
    first = min(samples.period_ends) - rows
    ahead[first::rows, 2] += 2.0 * LIMITS[2].acceleration * T  # the first row of each period
    refusal(replace(samples, feedforward=ahead), "'axis3'")


@settings(max_examples=40, deadline=None)
@given(st.floats(0.0, 1.0), st.floats(0.01, 3.1), st.floats(0.0, 6.2), st.integers(0, 2))
def test_an_accepted_feedforward_is_commanded_within_the_limits(
    size: float, pace: float, phase: float, joint: int
) -> None:
    """Either the feedforward is refused, or a simulated position loop with it stays within limits.

    These are position, velocity with its margin, and 1.5 times the acceleration.
    """
    samples = motion(periods=1)
    k = np.arange(len(samples), dtype=float)
    ahead = samples.velocity.copy()
    ahead[:, joint] += size * LIMITS[joint].velocity * window(k, len(k)) * np.sin(pace * k + phase)
    samples = replace(samples, feedforward=ahead)
    try:
        verify_command(samples, CELL.config, CELL.robot)
    except LimitError:
        return
    at, before = samples.position[0].copy(), np.zeros(3)
    for position, velocity in zip(samples.position, ahead, strict=True):
        command = GAIN * (position - at) + velocity
        for number, limits in enumerate(LIMITS):
            assert limits.position_min - 2e-3 <= at[number] <= limits.position_max + 2e-3
            assert abs(command[number]) <= 1.01 * MARGIN * limits.velocity
            change = abs(command[number] - before[number]) / T
            assert change <= 1.5 * limits.acceleration
        at, before = at + T * command, command


def test_a_command_too_fast_for_a_motor_of_a_coupled_wrist_is_refused() -> None:
    """The motor speed is alpha3' = q3' + 50 q2'; each joint is within its limits."""
    coupling = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -50.0, 1.0))
    coupled = CELL.robot.model_copy(update={"coupling": coupling})
    samples = motion()
    samples = replace(samples, feedforward=samples.velocity)
    verify_command(samples, CELL.config, CELL.robot)
    with raises_code(LimitError, "RID-MOTION-COMMAND", "motor", "axis3"):
        verify_command(samples, CELL.config, coupled)
