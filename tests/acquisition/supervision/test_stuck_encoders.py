"""Distinction between a stuck encoder and a joint in stiction (docs/faults.md, row 14)."""

from __future__ import annotations

import pytest

from acquisition.supervision.stop_reason import StopCode
from acquisition.supervision.stuck_encoders import STUCK_FRACTION, StuckEncoders
from config.cell.cell import Supervision
from config.robot.robot import RobotDescription

RULES = Supervision()
CYCLES = RULES.stuck_encoder_cycles
FAST, SLOW = (factor * RULES.stuck_encoder_velocity_rad_s for factor in (1.1, 0.9))


@pytest.fixture
def encoders(robot: RobotDescription) -> StuckEncoders:
    return StuckEncoders(RULES, robot)


def cycle_of_stop(
    encoders: StuckEncoders,
    command: float,
    *,
    velocity: float = 0.0,
    rising_nm: float = 0.0,
    periods: int = 1,
) -> int | None:
    """Return the cycle in which the second joint's encoder counts as stuck, or None."""
    encoders.check(1, command, command, 0.0, 1)  # still moving
    for cycle in range(1, 50):
        reason = encoders.check(1, command, velocity, rising_nm * cycle, periods)
        if reason is not None:
            assert (reason.code, reason.joint) == (StopCode.STUCK_ENCODER, "joint2")
            return cycle
    return None


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_joint_that_does_not_follow_a_fast_command_is_stuck(
    encoders: StuckEncoders, sign: float
) -> None:
    assert cycle_of_stop(encoders, sign * FAST) == CYCLES


def test_a_joint_that_does_not_follow_a_slow_command_can_be_in_stiction(
    encoders: StuckEncoders,
) -> None:
    assert cycle_of_stop(encoders, SLOW) is None


def test_a_slow_command_with_rising_torque_is_a_stuck_encoder(
    encoders: StuckEncoders, robot: RobotDescription
) -> None:
    strain_nm = RULES.stuck_encoder_torque_fraction * robot.joints[1].limits.torque
    assert cycle_of_stop(encoders, SLOW, rising_nm=1.01 * strain_nm) == CYCLES


@pytest.mark.parametrize(("rising", "named"), [(0.0, True), (1.01, False)])
def test_the_velocity_unit_is_named_if_the_torque_does_not_rise(
    encoders: StuckEncoders, robot: RobotDescription, rising: float, named: bool
) -> None:
    """A drive that reads a command in a much larger unit does not move and needs no torque."""
    rise_nm = rising * RULES.stuck_encoder_torque_fraction * robot.joints[1].limits.torque
    encoders.check(1, FAST, FAST, 0.0, 1)
    reasons = [encoders.check(1, FAST, 0.0, rise_nm * cycle, 1) for cycle in range(1, CYCLES + 1)]
    assert reasons[-1] is not None
    assert ("velocity_unit" in reasons[-1].text) is named


def cycle_of_stop_after_braking(
    encoders: StuckEncoders, strain_nm: float, after_nm: float
) -> int | None:
    """Return the cycle in which a joint that stopped abruptly counts as stuck, or None.

    The drive's filter delays the braking torque by some cycles.
    """
    for speed in (4.0 * FAST, 2.0 * FAST, 0.5 * SLOW):
        assert encoders.check(1, SLOW, speed, -1.5 * strain_nm, 1) is None
    for cycle, filtered_nm in enumerate((-1.4, -1.0, -0.5, 0.0, 0.0), start=1):
        if encoders.check(1, SLOW, 0.0, filtered_nm * strain_nm, 1) is not None:
            return cycle
    for cycle in range(6, 100):
        if encoders.check(1, SLOW, 0.0, after_nm * (cycle - 5), 1) is not None:
            return cycle
    return None


def test_the_end_of_hard_braking_is_not_a_stuck_encoder(
    encoders: StuckEncoders, robot: RobotDescription
) -> None:
    """The joint stops abruptly and sticks while the velocity loop settles."""
    strain_nm = RULES.stuck_encoder_torque_fraction * robot.joints[1].limits.torque
    assert cycle_of_stop_after_braking(encoders, strain_nm, 0.0) is None


def test_rising_torque_after_braking_is_a_stuck_encoder(
    encoders: StuckEncoders, robot: RobotDescription
) -> None:
    strain_nm = RULES.stuck_encoder_torque_fraction * robot.joints[1].limits.torque
    assert cycle_of_stop_after_braking(encoders, strain_nm, 0.2 * strain_nm) == 5 + 6 + CYCLES - 1


def test_a_joint_without_a_command_is_never_stuck(encoders: StuckEncoders) -> None:
    assert cycle_of_stop(encoders, 0.0, rising_nm=100.0) is None


@pytest.mark.parametrize(("share", "stuck"), [(0.99, True), (1.01, False)])
def test_a_joint_is_stuck_below_a_fraction_of_the_commanded_speed(
    encoders: StuckEncoders, share: float, stuck: bool
) -> None:
    found = cycle_of_stop(encoders, FAST, velocity=share * STUCK_FRACTION * FAST)
    assert (found is not None) is stuck


def test_skipped_cycles_are_counted(encoders: StuckEncoders) -> None:
    assert cycle_of_stop(encoders, FAST, periods=CYCLES) == 1


def test_a_movement_restarts_the_count(encoders: StuckEncoders) -> None:
    for _ in range(3):
        for _ in range(CYCLES - 1):
            assert encoders.check(1, FAST, 0.0, 0.0, 1) is None
        assert encoders.check(1, FAST, FAST, 0.0, 1) is None


def test_the_speed_of_a_prismatic_joint_is_shown_in_metres(robot: RobotDescription) -> None:
    sliding = robot.joints[1].model_copy(update={"type": "prismatic"})
    joints = (robot.joints[0], sliding, *robot.joints[2:])
    encoders = StuckEncoders(RULES, robot.model_copy(update={"joints": joints}))
    reason = encoders.check(1, FAST, 0.0, 0.0, CYCLES)
    assert reason is not None
    assert f"{FAST:.4g} m/s" in reason.text
