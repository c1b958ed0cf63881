"""Supervisor of a wrist in which motors 2 and 3 move joint 3: q3 = alpha3 - 0.5 alpha2."""

from __future__ import annotations

import pytest

from acquisition.supervision.cycle import Cycle
from acquisition.supervision.stop_reason import StopCode
from config.cell.cell import CellConfig
from config.robot.robot import RobotDescription
from tests.acquisition.supervision.test_supervisor import (
    SPEED,
    T,
    Watch,
    at_speed,
    cycle_at,
    set_at,
)


@pytest.fixture
def watch(cell: CellConfig, robot: RobotDescription) -> Watch:
    coupling = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -0.5, 1.0))
    return at_speed(cell, robot.model_copy(update={"coupling": coupling}))


def test_joints_that_follow_stop_nothing(watch: Watch) -> None:
    assert watch.run(lambda cycle: None) == (None, None)


def test_a_joint_is_unknown_while_one_of_its_motors_is_silent(watch: Watch) -> None:
    fault = set_at("received", lambda number: number in (10, 11), 1, False)
    valid_of_cycle: dict[int, list[int]] = {}
    for number in range(1, 21):
        cycle = cycle_at(number, SPEED * T * number)
        fault(cycle)
        assert watch.judge(cycle) is None
        valid_of_cycle[number] = cycle.valid
    assert valid_of_cycle[10] == valid_of_cycle[11] == [1, 0, 0]
    assert valid_of_cycle[12] == [1, 1, 1]


def test_missed_answers_are_counted_for_the_silent_drive(watch: Watch) -> None:
    number, reason = watch.run(set_at("received", lambda n: n >= 10, 1, False))
    assert number == 12
    assert reason is not None
    assert (reason.code, reason.joint) == (StopCode.MISSED_FRAMES, "joint2")


def test_a_joint_whose_motors_are_silent_in_turn_stops_the_motion(
    cell: CellConfig, robot: RobotDescription
) -> None:
    """No drive misses two cycles in a row, but the position of joint 3 is never known
    completely.
    """
    coupling = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.5, -0.5, 1.0))
    watch = at_speed(cell, robot.model_copy(update={"coupling": coupling}))

    def fault(cycle: Cycle) -> None:
        if cycle.number >= 10:
            cycle.received[cycle.number % 2] = False

    number, reason = watch.run(fault)
    assert number == 12
    assert reason is not None
    assert (reason.code, reason.joint) == (StopCode.MISSED_FRAMES, "joint3")
    assert "joint1, joint2, joint3" in reason.text
    assert (reason.value, reason.limit) == (3.0, 3.0)


def test_a_known_position_in_between_restarts_the_count(watch: Watch) -> None:
    assert watch.run(set_at("received", lambda n: n % 3 != 0, 1, False)) == (None, None)


def test_a_position_jump_in_between_does_not_restart_the_count(watch: Watch) -> None:
    """The value that arrives between the two lost answers is not a plausible position."""

    def fault(cycle: Cycle) -> None:
        if cycle.number in (10, 12, 13):
            cycle.received[1] = False
        elif cycle.number == 11:
            cycle.position[2] += 1.0

    number, reason = watch.run(fault)
    assert number == 13
    assert reason is not None
    assert (reason.code, reason.joint) == (StopCode.MISSED_FRAMES, "joint3")


def test_a_stuck_motor_is_detected_although_another_one_moves_its_joint(
    watch: Watch,
) -> None:
    """Motor 3 does not move (alpha3 = const); joint 3 turns backwards with motor 2."""

    def fault(cycle: Cycle) -> None:
        if cycle.number >= 10:
            passed = cycle.number - 9
            cycle.position[2] = SPEED * T * 9 - 0.5 * SPEED * T * passed
            cycle.target.position[2] = cycle.position[2]

    number, reason = watch.run(fault)
    assert reason is not None
    assert (reason.code, reason.joint) == (StopCode.STUCK_ENCODER, "joint3")
    assert number is not None
    assert number <= 9 + 8


def test_a_command_faster_than_a_motors_axis_allows_is_refused(
    watch: Watch, robot: RobotDescription
) -> None:
    """The motor's speed alpha3' = q3' + 0.5 q2' is above its limit; no joint is too fast."""
    limit = robot.joints[2].limits.velocity
    fast = [0.0, robot.joints[1].limits.velocity, 0.9 * limit]
    cycle = cycle_at(1, SPEED * T)
    cycle.command = fast
    reason = watch.judge(cycle)
    assert reason is not None
    assert (reason.code, reason.joint) == (StopCode.SET_POINT, "joint3")
    assert "for its motor" in reason.text


def test_a_motor_measured_faster_than_its_axis_allows_stops_the_motion(watch: Watch) -> None:
    """The motor's speed alpha3' = q3' + 0.5 q2' is 2.9 rad/s (limit 2.2); no joint is too fast."""

    def fault(cycle: Cycle) -> None:
        if cycle.number == 10:
            cycle.position[1] += (2.0 - SPEED) * T
            cycle.position[2] += (1.9 - SPEED) * T

    number, reason = watch.run(fault)
    assert number == 10
    assert reason is not None
    assert (reason.code, reason.joint) == (StopCode.VELOCITY_LIMIT, "joint3")
    assert reason.value == pytest.approx(2.9)
    assert reason.limit == pytest.approx(2.2)
