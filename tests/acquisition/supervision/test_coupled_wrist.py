"""The supervisor of a wrist whose joint 3 hangs on motors 2 and 3: q3 = alpha3 - 0.5 alpha2."""

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


def test_all_is_well_where_the_joints_follow(watch: Watch) -> None:
    assert watch.run(lambda cycle: None) == (None, None)


def test_a_joint_is_unknown_while_one_of_its_motors_is_silent(watch: Watch) -> None:
    fault = set_at("received", lambda number: number in (10, 11), 1, False)
    seen: dict[int, list[int]] = {}
    for number in range(1, 21):
        cycle = cycle_at(number, SPEED * T * number)
        fault(cycle)
        assert watch.judge(cycle) is None
        seen[number] = cycle.valid
    assert seen[10] == seen[11] == [1, 0, 0]
    assert seen[12] == [1, 1, 1]


def test_silence_is_counted_for_the_drive_that_is_silent(watch: Watch) -> None:
    number, reason = watch.run(set_at("received", lambda n: n >= 10, 1, False))
    assert number == 12
    assert reason is not None
    assert (reason.code, reason.joint) == (StopCode.MISSED_FRAMES, "joint2")


def test_a_joint_is_not_left_unknown_where_its_motors_are_silent_in_turn(
    cell: CellConfig, robot: RobotDescription
) -> None:
    """No drive misses two cycles in a row, and joint 3 is never known."""
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


def test_a_position_that_is_known_in_between_begins_the_count_anew(watch: Watch) -> None:
    assert watch.run(set_at("received", lambda n: n % 3 != 0, 1, False)) == (None, None)


def test_a_jump_in_between_does_not(watch: Watch) -> None:
    """The received value was not a position either."""

    def fault(cycle: Cycle) -> None:
        if cycle.number in (10, 12, 13):
            cycle.received[1] = False
        elif cycle.number == 11:
            cycle.position[2] += 1.0

    number, reason = watch.run(fault)
    assert number == 13
    assert reason is not None
    assert (reason.code, reason.joint) == (StopCode.MISSED_FRAMES, "joint3")


def test_a_motor_that_stands_is_seen_although_its_joint_is_moved_by_another(
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


def test_a_motor_must_not_be_faster_than_its_axis_may_be(
    watch: Watch, robot: RobotDescription
) -> None:
    """alpha3' = q3' + 0.5 q2': both joints are within their limits, the motor is not."""
    limit = robot.joints[2].limits.velocity
    fast = [0.0, robot.joints[1].limits.velocity, 0.9 * limit]
    cycle = cycle_at(1, SPEED * T)
    cycle.command = fast
    reason = watch.judge(cycle)
    assert reason is not None
    assert (reason.code, reason.joint) == (StopCode.SET_POINT, "joint3")
    assert "for its motor" in reason.text


def test_a_motor_that_is_measured_faster_than_its_axis_may_be_stops(watch: Watch) -> None:
    """alpha3' = q3' + 0.5 q2' = 2.9 rad/s of 2.2, while both joints are within their limits."""

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
