"""The supervisor stops in the cycle and with the reason that the table of faults requires."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import combinations
from operator import attrgetter

import pytest

from acquisition.supervision.cycle import Cycle, SetPoint
from acquisition.supervision.held_positions import HeldPositions
from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.supervision.supervisor import Supervisor
from config.cell.cell import CellConfig
from config.robot.robot import RobotDescription
from drivers.interfaces.servo_axes import Answers, DriveEvent, EventKind

T = 0.008
SPEED = 0.5


SETTLE = (0.1, 0.2, 0.3, 0.4, SPEED)

Fault = Callable[[Cycle], None]


def cycle_at(number: int, where: float, speed: float = SPEED) -> Cycle:
    """Return a fault-free cycle of three joints at their set-points."""
    return Cycle(
        number=number,
        periods=1,
        lateness_s=0.0,
        target=SetPoint([where] * 3, [speed] * 3, [speed] * 3, number, 3),
        time_s=T * number,
        exchange_s=0.001,
        received=[True] * 3,
        enabled=[True] * 3,
        fault=[False] * 3,
        position=[where] * 3,
        torque_nm=[1.0] * 3,
        position_counts=[0] * 3,
        torque_raw=[0] * 3,
        statusword=[0x1237] * 3,
        events=[],
        late_frames=0,
        second_answers=[0] * 3,
        command=[speed] * 3,
    )


class Watch:
    """The supervisor as the cyclic task uses it: store positions, then judge the cycle."""

    def __init__(self, cell: CellConfig, robot: RobotDescription, start: float = 0.0) -> None:
        self.positions = HeldPositions(cell, robot)
        self.supervisor = Supervisor(cell, robot, self.positions)
        answers = Answers.initial(3)
        answers.position[:] = start
        self.supervisor.begin(answers)

    def judge(self, cycle: Cycle) -> StopReason | None:
        self.positions.take(cycle)
        return self.supervisor.judge(cycle)

    def run(self, fault: Fault, cycles: int = 200) -> tuple[int, StopReason] | tuple[None, None]:
        """Run cycles 1, 2, ...; return the cycle and the reason of the stop, or None for both."""
        for number in range(1, cycles + 1):
            cycle = cycle_at(number, SPEED * T * number)
            fault(cycle)
            if (reason := self.judge(cycle)) is not None:
                return number, reason
        return None, None


def at_speed(cell: CellConfig, robot: RobotDescription) -> Watch:
    """Return a supervisor whose motion has just reached its speed, at position 0."""
    where = -T * sum(SETTLE)
    watch = Watch(cell, robot, where)
    for number, speed in enumerate(SETTLE, 1 - len(SETTLE)):
        where += T * speed
        assert watch.judge(cycle_at(number, where, speed)) is None
    return watch


@pytest.fixture
def watch(cell: CellConfig, robot: RobotDescription) -> Watch:
    return at_speed(cell, robot)


def event(kind: EventKind, code: int = 0) -> DriveEvent:
    return DriveEvent(kind, "joint2", 0.0, f"joint2: {kind.name}", code)


def set_at(name: str, at: Callable[[int], bool], joint: int, value: object) -> Fault:
    """Return a fault that sets one joint's value in the cycles that `at` selects."""

    def fault(cycle: Cycle) -> None:
        if at(cycle.number):
            attrgetter(name)(cycle)[joint] = value

    return fault


def event_at(at: Callable[[int], bool], event: DriveEvent) -> Fault:
    def fault(cycle: Cycle) -> None:
        if at(cycle.number):
            cycle.events = [event]

    return fault


def late(at: Callable[[int], bool], count: int = 1) -> Fault:
    """Return a fault with `count` late answers in the cycles that `at` selects."""

    def fault(cycle: Cycle) -> None:
        cycle.late_frames = count * sum(map(at, range(1, cycle.number + 1)))

    return fault


def stuck(joint: int, since: int) -> Fault:
    def fault(cycle: Cycle) -> None:
        if cycle.number >= since:
            cycle.position[joint] = SPEED * T * (since - 1)

    return fault


def at_rest_in_stiction(feedforward: float) -> Fault:
    """Return a change of each cycle: the joints rest, and the feedforward rises to this value
    [rad/s].
    """

    def fault(cycle: Cycle) -> None:
        where = SPEED * T
        ahead = [feedforward * min(1.0, cycle.number / 20)] * 3  # the load rises gradually
        cycle.target = SetPoint([where] * 3, [0.0] * 3, ahead, cycle.number, 5)
        cycle.position = [where] * 3
        cycle.command = ahead

    return fault


def compensated_to_nothing(cycle: Cycle) -> None:
    """Reduce the feedforward to 0 within 5 cycles; the second joint is stuck from cycle 10 on."""
    ahead = [SPEED * max(0.0, 1.0 - cycle.number / 5)] * 3
    cycle.target = SetPoint(cycle.target.position, [SPEED] * 3, ahead, cycle.number, 3)
    cycle.command = ahead
    stuck(1, 10)(cycle)


def test_a_feedforward_at_rest_is_not_a_stuck_encoder(
    cell: CellConfig, robot: RobotDescription
) -> None:
    """The joint is at rest at its set-point and holds a torque."""
    at_rest = Watch(cell, robot, SPEED * T)
    assert at_rest.run(at_rest_in_stiction(0.4)) == (None, None)


def test_a_stuck_encoder_is_detected_despite_a_feedforward(watch: Watch) -> None:
    number, reason = watch.run(compensated_to_nothing)
    assert number == 14
    assert reason is not None
    assert (reason.code, reason.joint) == (StopCode.STUCK_ENCODER, "joint2")


def in_fault(joint: int, since: int) -> Fault:
    def fault(cycle: Cycle) -> None:
        if cycle.number >= since:
            cycle.enabled[joint], cycle.fault[joint] = False, True

    return fault


def runaway(joint: int, since: int) -> Fault:
    """Return a fault that turns the joint in the wrong direction at 1.5 rad/s."""

    def fault(cycle: Cycle) -> None:
        if cycle.number >= since:
            passed = cycle.number - since + 1
            cycle.position[joint] = SPEED * T * (since - 1) - 1.5 * T * passed

    return fault


def doubled(at: Callable[[int], bool], *, differs: bool = False) -> Fault:
    """Return a fault with two answers of the second joint; if they differ, neither is used."""

    def fault(cycle: Cycle) -> None:
        cycle.second_answers[1] = sum(map(at, range(1, cycle.number + 1)))
        if differs and at(cycle.number):
            cycle.received[1] = False

    return fault


# The number before a colon is the row of the fault in docs/faults.md.
STOPS: dict[str, tuple[Fault, StopCode, int]] = {
    "2: three frames of one drive are missed": (
        set_at("received", lambda k: k >= 10, 1, False), StopCode.MISSED_FRAMES, 12),
    "5: three answers late within 100 cycles": (
        late(lambda k: k in (10, 50, 100)), StopCode.LATE_FRAMES, 100),
    "6: two corrupted positions in a row": (
        set_at("position", lambda k: k >= 10, 0, 3.0), StopCode.IMPLAUSIBLE_POSITION, 11),
    "6: a position that is not a number": (
        set_at("position", lambda k: k >= 10, 0, math.nan), StopCode.IMPLAUSIBLE_POSITION, 11),
    "8: a drive restarts": (
        event_at(lambda k: k == 10, event(EventKind.BOOT_UP)),
        StopCode.DRIVE_RESTARTED, 10),
    "9: an emergency message": (
        event_at(lambda k: k == 10, event(EventKind.EMERGENCY, 0x2310)),
        StopCode.EMERGENCY, 10),
    "11: a heartbeat is lost": (
        event_at(lambda k: k == 10, event(EventKind.HEARTBEAT_LOST)),
        StopCode.HEARTBEAT_LOST, 10),
    "7: a frame of the wrong length": (
        event_at(lambda k: k == 10, event(EventKind.WRONG_LENGTH)), StopCode.BUS, 10),
    "13: a drive is no longer enabled": (
        set_at("enabled", lambda k: k >= 10, 2, False), StopCode.NOT_ENABLED, 10),
    "49: second answers in 20 of 100 cycles": (
        doubled(lambda k: k >= 10 and k % 5 == 0), StopCode.SECOND_ANSWERS, 105),
    "49: two answers that differ, three times in a row": (
        doubled(lambda k: k >= 10, differs=True), StopCode.SECOND_ANSWERS, 12),
    "a drive in fault": (
        in_fault(2, 10), StopCode.DRIVE_FAULT, 10),
    "14: a stuck encoder": (stuck(1, 10), StopCode.STUCK_ENCODER, 14),
    # the error grows by 2 rad/s: it exceeds 0.02 rad + 0.1 s x 0.5 rad/s in the fifth cycle
    "15: a runaway": (runaway(0, 10), StopCode.FOLLOWING_ERROR, 14),
    "a torque beyond its limit": (
        set_at("torque_nm", lambda k: k >= 10, 1, -111.0), StopCode.TORQUE_LIMIT, 10),
    "a velocity beyond its limit": (
        set_at("position", lambda k: k == 10, 1, SPEED * T * 9 + 2.3 * T),
        StopCode.VELOCITY_LIMIT, 10),
    "17: a set-point that is not a number": (
        set_at("target.position", lambda k: k == 10, 1, math.nan), StopCode.SET_POINT, 10),
    "17: a command that is not a number": (
        set_at("command", lambda k: k == 10, 1, math.nan), StopCode.SET_POINT, 10),
    "17: an infinite command": (
        set_at("command", lambda k: k == 10, 1, math.inf), StopCode.SET_POINT, 10),
    "17: a step of the set-point": (
        set_at("target.position", lambda k: k == 10, 1, SPEED * T * 10 + 0.03),
        StopCode.SET_POINT, 10),
    "17: a step of its velocity": (
        set_at("target.velocity", lambda k: k == 10, 1, 0.7), StopCode.SET_POINT, 10),
    "17: a velocity beyond its limit": (
        set_at("target.velocity", lambda k: k == 10, 0, 2.3), StopCode.SET_POINT, 10),
}  # fmt: skip

GOES_ON: dict[str, Fault] = {
    "nothing at all": lambda cycle: None,
    "1: one frame is missed": set_at("received", lambda k: k == 10, 1, False),
    "3: single frames are missed now and then": set_at("received", lambda k: k % 20 < 2, 1, False),
    "5: answers late together in two of 100 cycles": late(lambda k: k % 60 == 0, 3),
    "6: one corrupted position": set_at("position", lambda k: k == 10, 0, 3.0),
    "49: a second answer in every sixth cycle": doubled(lambda k: k % 6 == 0),
    "49: two answers that differ, twice in a row": doubled(lambda k: k in (10, 11), differs=True),
    "an emergency is cleared": event_at(lambda k: k == 10, event(EventKind.EMERGENCY_CLEARED)),
    "an unexpected frame": event_at(lambda k: k == 10, event(EventKind.UNEXPECTED_FRAME)),
}


@pytest.mark.parametrize("name", STOPS)
def test_the_motion_stops_in_the_right_cycle_for_the_right_reason(watch: Watch, name: str) -> None:
    fault, code, at = STOPS[name]
    number, reason = watch.run(fault)
    assert reason is not None
    assert (reason.code, number) == (code, at)
    assert reason.text


@pytest.mark.parametrize("name", GOES_ON)
def test_the_motion_continues_with_tolerable_faults(watch: Watch, name: str) -> None:
    assert watch.run(GOES_ON[name]) == (None, None)


def both(first: Fault, second: Fault) -> Fault:
    def fault(cycle: Cycle) -> None:
        first(cycle)
        second(cycle)

    return fault


IN_ORDER: tuple[tuple[str, Fault], ...] = (
    ("EMERGENCY", event_at(lambda k: k == 30, event(EventKind.EMERGENCY, 0x2310))),
    ("answers of drives came too late", late(lambda k: k in (28, 29, 30))),
    ("two devices send", doubled(lambda k: 10 < k <= 30)),
    ("the set-point's velocity jumps", set_at("target.velocity", lambda k: k == 30, 2, 0.7)),
    ("joint1: its drive did not answer", set_at("received", lambda k: k in (28, 29, 30), 0, False)),
    ("joint2: its drive is no longer", set_at("enabled", lambda k: k == 30, 1, False)),
    ("joint2: its position jumps", set_at("position", lambda k: k in (29, 30), 1, 3.0)),
    ("joint3: its torque", set_at("torque_nm", lambda k: k == 30, 2, 111.0)),
    ("joint3: the set-point's velocity command", set_at("command", lambda k: k == 30, 2, math.inf)),
)


@pytest.mark.parametrize(("first", "second"), list(combinations(range(len(IN_ORDER)), 2)))
def test_of_two_faults_in_one_cycle_the_first_checked_is_reported(
    watch: Watch, first: int, second: int
) -> None:
    words, fault = IN_ORDER[first]
    number, reason = watch.run(both(IN_ORDER[second][1], fault))
    assert reason is not None
    assert number == 30
    assert words in reason.text


def lags(joint: int, by: float, since: int) -> Fault:
    def fault(cycle: Cycle) -> None:
        cycle.position[joint] -= by * max(0, cycle.number - since)

    return fault


OF_ONE_JOINT: tuple[tuple[StopCode, Fault], ...] = (
    (StopCode.DRIVE_FAULT, in_fault(1, 30)),
    (StopCode.VELOCITY_LIMIT, set_at("position", lambda k: k == 30, 1, SPEED * T * 29 + 2.3 * T)),
    (StopCode.TORQUE_LIMIT, set_at("torque_nm", lambda k: k == 30, 1, 111.0)),
    (StopCode.FOLLOWING_ERROR, lags(1, 0.0179, 26)),
)


@pytest.mark.parametrize(("first", "second"), [(0, 1), (0, 2), (0, 3), (1, 2), (2, 3)])
def test_of_two_faults_of_a_joint_the_first_checked_is_reported(
    watch: Watch, first: int, second: int
) -> None:
    code, fault = OF_ONE_JOINT[first]
    number, reason = watch.run(both(fault, OF_ONE_JOINT[second][1]))
    assert reason is not None
    assert (number, reason.code) == (30, code)


def test_without_a_plausible_position_the_following_error_is_kept(watch: Watch) -> None:
    behind = 0.001
    cycles: dict[int, tuple[list[int], list[float]]] = {}
    for number in range(1, 14):
        cycle = cycle_at(number, SPEED * T * number)
        cycle.position = [place - behind for place in cycle.position]
        if number in (10, 11):
            cycle.received[1] = False
        if number == 11:
            cycle.position[2] = 1e9
        assert watch.judge(cycle) is None
        cycles[number] = (cycle.valid, list(watch.positions.position))
    for number, valid in ((9, [1, 1, 1]), (10, [1, 0, 1]), (11, [1, 0, 0]), (12, [1, 1, 1])):
        assert cycles[number][0] == valid
        assert cycles[number][1] == pytest.approx([SPEED * T * number - behind] * 3)


def test_a_position_beyond_its_limit_stops_the_motion(
    cell: CellConfig, robot: RobotDescription
) -> None:
    watch = Watch(cell, robot, 2.015)
    cycle = cycle_at(1, 2.015, 0.0)
    cycle.position[0] = 2.021
    reason = watch.judge(cycle)
    assert reason is not None
    assert reason.code is StopCode.POSITION_LIMIT
    assert (reason.joint, reason.value) == ("joint1", 2.021)
    assert reason.limit == pytest.approx(2.02)


def test_after_skipped_cycles_a_larger_position_step_is_accepted(watch: Watch) -> None:
    cycle = cycle_at(8, SPEED * T * 8)
    cycle.periods = 8
    assert watch.judge(cycle) is None


def test_a_refused_set_point_is_not_the_reference_for_the_next(watch: Watch) -> None:
    for _ in range(2):
        assert watch.judge(cycle_at(1, 1.0, 0.0)) is not None


def test_the_text_names_joint_value_limit_and_what_to_check(watch: Watch) -> None:
    _, reason = watch.run(set_at("torque_nm", lambda k: k >= 10, 1, -111.0))
    assert reason is not None
    assert reason.text.startswith("joint joint2: its torque is -111 N m, beyond 110 N m. Check")


@pytest.mark.promise("sum-verified")
@pytest.mark.parametrize("joint", [0, 1, 2])
@pytest.mark.parametrize("ahead", [math.nan, math.inf, -math.inf, 1e3, SPEED + 0.2, SPEED - 0.2])
def test_a_feedforward_that_jumps_or_is_not_finite_is_never_sent(
    cell: CellConfig, robot: RobotDescription, joint: int, ahead: float
) -> None:
    """Set-points of a source cannot be checked in advance, so that this is the only guard."""
    number, reason = at_speed(cell, robot).run(
        set_at("target.feedforward", lambda k: k == 5, joint, ahead)
    )
    assert number == 5
    assert reason is not None
    assert reason.code is StopCode.SET_POINT
    assert "feedforward" in reason.text
