"""The supervisor against the table of faults: how many cycles until which reason to stop."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.supervision.supervisor import Supervisor
from config.cell.cell import CellConfig
from config.robot.robot import RobotDescription
from drivers.interfaces.servo_axes import Answers, DriveEvent, EventKind

T = 0.008
SPEED = 0.5


@dataclass
class Cycle:
    """What one cycle brings: three joints that move at 0.5 rad/s, exactly as told."""

    number: int
    position: list[float]
    target: list[float]
    received: list[bool] = field(default_factory=lambda: [True] * 3)
    torque: list[float] = field(default_factory=lambda: [1.0] * 3)
    enabled: list[bool] = field(default_factory=lambda: [True] * 3)
    in_fault: list[bool] = field(default_factory=lambda: [False] * 3)
    events: list[DriveEvent] = field(default_factory=list)
    lateness_s: float = 0.0
    late_frames: int = 0
    second_answers: int = 0  # of the second joint, so far
    target_velocity: list[float] = field(default_factory=lambda: [SPEED] * 3)
    command: list[float] = field(default_factory=lambda: [SPEED] * 3)

    def answers(self) -> Answers:
        answers = Answers.before_any(3)
        answers.received[:] = self.received
        answers.position[:] = self.position
        answers.torque_nm[:] = self.torque
        answers.enabled[:] = self.enabled
        answers.fault[:] = self.in_fault
        return answers


Fault = Callable[[Cycle], None]


@pytest.fixture
def supervisor(cell: CellConfig, robot: RobotDescription) -> Supervisor:
    """A supervisor whose set-point has just come up to speed."""
    supervisor = Supervisor(cell, robot)
    supervisor.begin([0.0, 0.0, 0.0])
    for speed in (0.1, 0.2, 0.3, 0.4, SPEED):
        assert supervisor.check_set_point([0.0] * 3, [speed] * 3, [speed] * 3) is None
    return supervisor


def run(
    supervisor: Supervisor, fault: Fault, cycles: int = 200
) -> tuple[int, StopReason] | tuple[None, None]:
    """Run cycles 1, 2, ...; return when and why the supervisor stops."""
    for number in range(1, cycles + 1):
        where = SPEED * T * number
        cycle = Cycle(number, [where] * 3, [where] * 3)
        fault(cycle)
        reason = (
            supervisor.check_timing(cycle.lateness_s)
            or supervisor.check_events(cycle.events)
            or supervisor.check_late_frames(cycle.late_frames)
            or supervisor.check_second_answers([0, cycle.second_answers, 0])
            or supervisor.check_measured(cycle.answers(), cycle.target, cycle.target_velocity)
            or supervisor.check_set_point(cycle.target, cycle.target_velocity, cycle.command)
        )
        if reason is not None:
            return number, reason
    return None, None


def event(kind: EventKind, code: int = 0) -> DriveEvent:
    return DriveEvent(kind, "joint2", 0.0, f"joint2: {kind.name}", code)


def set_at(name: str, at: Callable[[int], bool], joint: int, value: object) -> Fault:
    """Return a fault that puts a value in one joint's place in the cycles that `at` picks."""

    def fault(cycle: Cycle) -> None:
        if at(cycle.number):
            getattr(cycle, name)[joint] = value

    return fault


def every(name: str, at: Callable[[int], bool], value: object) -> Fault:
    def fault(cycle: Cycle) -> None:
        if at(cycle.number):
            setattr(cycle, name, value)

    return fault


def stuck(joint: int, since: int) -> Fault:
    def fault(cycle: Cycle) -> None:
        if cycle.number >= since:
            cycle.position[joint] = SPEED * T * (since - 1)

    return fault


def in_fault(joint: int, since: int) -> Fault:
    def fault(cycle: Cycle) -> None:
        if cycle.number >= since:
            cycle.enabled[joint], cycle.in_fault[joint] = False, True

    return fault


def runaway(joint: int, since: int) -> Fault:
    """The joint turns the other way at 1.5 rad/s."""

    def fault(cycle: Cycle) -> None:
        if cycle.number >= since:
            passed = cycle.number - since + 1
            cycle.position[joint] = SPEED * T * (since - 1) - 1.5 * T * passed

    return fault


def doubled(at: Callable[[int], bool], *, differs: bool = False) -> Fault:
    """The second joint's identifier answers twice; where the two differ, neither is received."""

    def fault(cycle: Cycle) -> None:
        cycle.second_answers = sum(map(at, range(1, cycle.number + 1)))
        if differs and at(cycle.number):
            cycle.received[1] = False

    return fault


STOPS: dict[str, tuple[Fault, StopCode, int]] = {
    "2: three frames of one drive are missed": (
        set_at("received", lambda k: k >= 10, 1, False), StopCode.MISSED_FRAMES, 12),
    "5: three answers late within 100 cycles": (
        every("late_frames", lambda k: k in (10, 50, 100), 1), StopCode.LATE_FRAMES, 100),
    "6: two corrupted positions in a row": (
        set_at("position", lambda k: k >= 10, 0, 3.0), StopCode.IMPLAUSIBLE_POSITION, 11),
    "6: a position that is not a number": (
        set_at("position", lambda k: k >= 10, 0, math.nan), StopCode.IMPLAUSIBLE_POSITION, 11),
    "8: a drive restarts": (
        every("events", lambda k: k == 10, [event(EventKind.BOOT_UP)]),
        StopCode.DRIVE_RESTARTED, 10),
    "9: an emergency message": (
        every("events", lambda k: k == 10, [event(EventKind.EMERGENCY, 0x2310)]),
        StopCode.EMERGENCY, 10),
    "11: a heartbeat is lost": (
        every("events", lambda k: k == 10, [event(EventKind.HEARTBEAT_LOST)]),
        StopCode.HEARTBEAT_LOST, 10),
    "7: a frame of the wrong length": (
        every("events", lambda k: k == 10, [event(EventKind.WRONG_LENGTH)]), StopCode.BUS, 10),
    "13: a drive is no longer enabled": (
        set_at("enabled", lambda k: k >= 10, 2, False), StopCode.NOT_ENABLED, 10),
    "49: second answers in 20 of 100 cycles": (
        doubled(lambda k: k >= 10 and k % 5 == 0), StopCode.SECOND_ANSWERS, 105),
    "49: two answers that differ, three times in a row": (
        doubled(lambda k: k >= 10, differs=True), StopCode.SECOND_ANSWERS, 12),
    "a drive in fault": (
        in_fault(2, 10), StopCode.DRIVE_FAULT, 10),
    "14: a stuck encoder": (stuck(1, 10), StopCode.STUCK_ENCODER, 14),
    # 2 rad/s apart: 0.02 rad + 0.1 s x 0.5 rad/s are passed in the fifth cycle
    "15: a runaway": (runaway(0, 10), StopCode.FOLLOWING_ERROR, 14),
    "a torque beyond its limit": (
        set_at("torque", lambda k: k >= 10, 1, -111.0), StopCode.TORQUE_LIMIT, 10),
    "a velocity beyond its limit": (
        set_at("position", lambda k: k == 10, 1, SPEED * T * 9 + 2.3 * T),
        StopCode.VELOCITY_LIMIT, 10),
    "17: a set-point that is not a number": (
        set_at("target", lambda k: k == 10, 1, math.nan), StopCode.FOLLOWING_ERROR, 10),
    "17: a command that is not a number": (
        set_at("command", lambda k: k == 10, 1, math.nan), StopCode.SET_POINT, 10),
    "17: an infinite command": (
        set_at("command", lambda k: k == 10, 1, math.inf), StopCode.SET_POINT, 10),
    "17: a step of the set-point": (
        set_at("target", lambda k: k >= 10, 1, SPEED * T * 10 + 0.03), StopCode.SET_POINT, 10),
    "17: a step of its velocity": (
        set_at("target_velocity", lambda k: k == 10, 1, 0.7), StopCode.SET_POINT, 10),
    "17: a velocity beyond its limit": (
        every("target_velocity", lambda k: k == 10, [2.3] * 3), StopCode.SET_POINT, 10),
    "27: three late cycles in a row": (
        every("lateness_s", lambda k: k >= 10, 0.6 * T), StopCode.LATE_CYCLE, 12),
    "27: one cycle later than two periods": (
        every("lateness_s", lambda k: k == 10, 2.1 * T), StopCode.LATE_CYCLE, 10),
    "27: a time that is not a number": (
        every("lateness_s", lambda k: k == 10, math.nan), StopCode.LATE_CYCLE, 10),
}  # fmt: skip

GOES_ON: dict[str, Fault] = {
    "nothing at all": lambda cycle: None,
    "1: one frame is missed": set_at("received", lambda k: k == 10, 1, False),
    "3: single frames are missed now and then": set_at("received", lambda k: k % 20 < 2, 1, False),
    "5: answers late together in two of 100 cycles": every("late_frames", lambda k: k % 60 == 0, 3),
    "6: one corrupted position": set_at("position", lambda k: k == 10, 0, 3.0),
    "49: a second answer in every sixth cycle": doubled(lambda k: k % 6 == 0),
    "49: two answers that differ, twice in a row": doubled(lambda k: k in (10, 11), differs=True),
    "27: a late cycle now and then": every("lateness_s", lambda k: k % 3 == 0, 1.5 * T),
    "an emergency is cleared": every(
        "events", lambda k: k == 10, [event(EventKind.EMERGENCY_CLEARED)]
    ),
    "a frame that nobody expects": every(
        "events", lambda k: k == 10, [event(EventKind.UNEXPECTED_FRAME)]
    ),
}


@pytest.mark.parametrize("name", STOPS)
def test_it_stops_in_the_right_cycle_for_the_right_reason(
    supervisor: Supervisor, name: str
) -> None:
    fault, code, at = STOPS[name]
    number, reason = run(supervisor, fault)
    assert reason is not None
    assert (reason.code, number) == (code, at)
    assert reason.text


@pytest.mark.parametrize("name", GOES_ON)
def test_it_goes_on(supervisor: Supervisor, name: str) -> None:
    assert run(supervisor, GOES_ON[name]) == (None, None)


def test_without_a_plausible_position_the_following_error_is_held(supervisor: Supervisor) -> None:
    behind = 0.001
    seen: dict[int, tuple[list[int], list[float]]] = {}

    def fault(cycle: Cycle) -> None:
        seen[cycle.number - 1] = (list(supervisor.valid), list(supervisor.position))
        cycle.position = [place - behind for place in cycle.position]
        if cycle.number in (10, 11):
            cycle.received[1] = False
        if cycle.number == 11:
            cycle.position[2] = 1e9

    run(supervisor, fault, 13)
    for number, valid in ((9, [1, 1, 1]), (10, [1, 0, 1]), (11, [1, 0, 0]), (12, [1, 1, 1])):
        assert seen[number][0] == valid
        assert seen[number][1] == pytest.approx([SPEED * T * number - behind] * 3)


def test_a_position_beyond_its_limit_stops(cell: CellConfig, robot: RobotDescription) -> None:
    supervisor = Supervisor(cell, robot)
    supervisor.begin([2.015, 0.0, 0.0])
    where = [2.015, 0.0, 0.0]
    answers = Cycle(1, [2.021, 0.0, 0.0], where).answers()
    reason = supervisor.check_measured(answers, where, [0.0] * 3)
    assert reason is not None
    assert reason.code is StopCode.POSITION_LIMIT
    assert (reason.joint, reason.value) == ("joint1", 2.021)
    assert reason.limit == pytest.approx(2.02)


def test_after_skipped_cycles_positions_may_have_gone_further(supervisor: Supervisor) -> None:
    further = [SPEED * T * 8] * 3
    answers = Cycle(1, further, further).answers()
    assert supervisor.check_measured(answers, further, [SPEED] * 3, 8) is None
    assert supervisor.check_set_point(further, [SPEED] * 3, [SPEED] * 3, 8) is None


def test_a_refused_set_point_is_not_taken_as_sent(supervisor: Supervisor) -> None:
    for _ in range(2):
        assert supervisor.check_set_point([1.0] * 3, [0.0] * 3, [0.0] * 3) is not None


def test_the_text_names_joint_value_limit_and_what_to_check(supervisor: Supervisor) -> None:
    _, reason = run(supervisor, set_at("torque", lambda k: k >= 10, 1, -111.0))
    assert reason is not None
    assert reason.text.startswith("joint joint2: its torque is -111 N m, beyond 110 N m. Check")


class TestCoupledWrist:
    """Joint 3 hangs on motors 2 and 3: q3 = alpha3 - 0.5 alpha2."""

    @pytest.fixture
    def supervisor(self, cell: CellConfig, robot: RobotDescription) -> Supervisor:
        coupling = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -0.5, 1.0))
        coupled = Supervisor(cell, robot.model_copy(update={"coupling": coupling}))
        coupled.begin([0.0, 0.0, 0.0])
        for speed in (0.1, 0.2, 0.3, 0.4, SPEED):
            assert coupled.check_set_point([0.0] * 3, [speed] * 3, [speed] * 3) is None
        return coupled

    def test_all_is_well_where_the_joints_follow(self, supervisor: Supervisor) -> None:
        assert run(supervisor, lambda cycle: None) == (None, None)

    def test_a_joint_is_unknown_while_one_of_its_motors_is_silent(
        self, supervisor: Supervisor
    ) -> None:
        fault = set_at("received", lambda number: number in (10, 11), 1, False)
        seen: list[list[int]] = []

        def watched(cycle: Cycle) -> None:
            seen.append(list(supervisor.valid))
            fault(cycle)

        assert run(supervisor, watched, 20) == (None, None)
        assert seen[10:12] == [[1, 0, 0], [1, 0, 0]]
        assert seen[12] == [1, 1, 1]

    def test_silence_is_counted_for_the_drive_that_is_silent(self, supervisor: Supervisor) -> None:
        number, reason = run(supervisor, set_at("received", lambda n: n >= 10, 1, False))
        assert number == 12
        assert reason is not None
        assert (reason.code, reason.joint) == (StopCode.MISSED_FRAMES, "joint2")

    def test_a_motor_that_stands_is_seen_although_its_joint_is_moved_by_another(
        self, supervisor: Supervisor
    ) -> None:
        """Motor 3 stands at alpha3 = const; joint 3 turns backwards with motor 2."""

        def fault(cycle: Cycle) -> None:
            if cycle.number >= 10:
                passed = cycle.number - 9
                cycle.position[2] = SPEED * T * 9 - 0.5 * SPEED * T * passed
                cycle.target[2] = cycle.position[2]

        number, reason = run(supervisor, fault)
        assert reason is not None
        assert (reason.code, reason.joint) == (StopCode.STUCK_ENCODER, "joint3")
        assert number is not None
        assert number <= 9 + 8

    def test_a_motor_must_not_be_faster_than_its_axis_may_be(
        self, supervisor: Supervisor, robot: RobotDescription
    ) -> None:
        """alpha3' = q3' + 0.5 q2': both joints are within their limits, the motor is not."""
        limit = robot.joints[2].limits.velocity
        fast = [0.0, robot.joints[1].limits.velocity, 0.9 * limit]
        reason = supervisor.check_set_point([0.0] * 3, [SPEED] * 3, fast)
        assert reason is not None
        assert (reason.code, reason.joint) == (StopCode.SET_POINT, "joint3")
        assert "for its motor" in reason.text
