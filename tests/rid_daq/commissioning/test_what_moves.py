"""Motion with a held key: the axis that moves, its distance, and the drive's counts afterwards."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.hold_to_run.line import HoldLine, LineCheck
from acquisition.journal.cycle_row import row_dtype
from config.arrays import FloatArray
from config.errors import PreflightError
from config.load import load_cell
from rid_daq.commissioning.axis_motion import AxisMotion, travelled_fraction
from rid_daq.commissioning.axis_verdict import ObservedMotion, check_axis_motion
from rid_daq.commissioning.held_run import HeldRun
from rid_daq.operations.cell import axis_tester
from rid_daq.operations.cell.axis_tester import AxisTester, visible_motion
from rid_daq.operations.cell.jogging import JogKeys
from rid_daq.recording.run_session import RunSession
from rid_daq.terminal.console import Console
from tests.builders.raised_codes import raises_code

LOADED = load_cell("ir361")
ROBOT = LOADED.robot
N = len(ROBOT.joints)
PER_REV = 65536
CYCLE_S = 0.008


@dataclass
class MessageLog:
    """A console that stores its messages."""

    lines: list[str] = field(default_factory=list)

    def say(self, text: str) -> None:
        self.lines.append(text)


def jog_keys(log: MessageLog, home: FloatArray | None = None, obstacle: str = "") -> JogKeys:
    """Return the keys of a jog whose straight motions are free, or have an obstacle in every
    direction.
    """

    def check(start: FloatArray, goal: FloatArray) -> HoldLine:
        return HoldLine(start, start if obstacle else goal, 1.0, obstacle)

    return JogKeys(ROBOT, home, cast(LineCheck, check), cast(Console, log))


@pytest.mark.parametrize(("key", "end"), [("+", "position_max"), ("-", "position_min")])
def test_a_held_key_moves_only_the_selected_joint_towards_its_limit(key: str, end: str) -> None:
    keys, pose = jog_keys(MessageLog()), np.full(N, 0.1)
    keys.tapped("3")
    line = keys.line(key, pose)
    assert line is not None
    assert line.goal[2] == getattr(ROBOT.joints[2].limits, end)
    assert np.delete(line.goal, 2).tolist() == np.delete(pose, 2).tolist()
    assert pose.tolist() == [0.1] * N


@pytest.mark.promise("held-key-tap")
def test_a_key_that_names_a_joint_moves_it_regardless_of_the_selection() -> None:
    keys = jog_keys(MessageLog())
    keys.tapped("1")
    line = keys.line("2+", np.zeros(N))
    assert line is not None
    assert np.flatnonzero(line.goal).tolist() == [1]


@pytest.mark.parametrize("key", ["2", "0+", f"{N + 1}+", "-1+", "x+", "²+", "2h", "++"])
def test_a_key_that_names_no_valid_joint_moves_nothing(key: str) -> None:
    assert jog_keys(MessageLog()).line(key, np.zeros(N)) is None


@pytest.mark.parametrize("key", [" ", "x", "0", "9", "h", "²"])
def test_any_other_key_moves_and_selects_nothing(key: str) -> None:
    log = MessageLog()
    keys = jog_keys(log)
    assert not keys.tapped(key)
    assert keys.line(key, np.zeros(N)) is None
    assert log.lines == []
    assert "Chosen: axis1" in keys.help


def test_h_moves_to_the_home_pose_of_the_cell() -> None:
    home = np.linspace(0.0, 0.5, N)
    keys = jog_keys(MessageLog(), home)
    line = keys.line("h", np.zeros(N))
    assert line is not None
    assert line.goal.tolist() == home.tolist()
    assert "hold h to go to the home pose" in keys.help


def test_q_ends_a_jog_and_a_blocked_motion_names_the_obstacle() -> None:
    log = MessageLog()
    keys = jog_keys(log, obstacle="floor")
    line = keys.line("+", np.zeros(N))
    assert line is not None
    assert line.is_empty
    assert log.lines == ["axis1 +: the robot cannot move further: floor is in the way."]
    assert keys.tapped("q")


def small_move(pose: FloatArray, number: int) -> HoldLine:
    """Return the small motion of the axis test from a pose."""
    session = SimpleNamespace(loaded=LOADED, cell=LOADED.config)
    made = AxisTester(cast(RunSession, session), cast(Console, MessageLog()), unattended=True)
    return made._plan_small_move(number, pose)


def pose_with_fraction(number: int, fraction: float) -> FloatArray:
    """Return a pose with all joints at mid-range, except one at a fraction of its range."""
    low = np.array([joint.limits.position_min for joint in ROBOT.joints])
    high = np.array([joint.limits.position_max for joint in ROBOT.joints])
    pose = 0.5 * (low + high)
    pose[number] = low[number] + fraction * (high - low)[number]
    return pose


def test_an_axis_test_moves_one_axis_by_two_degrees_towards_its_middle() -> None:
    for fraction, sign in ((0.3, 1.0), (0.7, -1.0)):
        pose = pose_with_fraction(0, fraction)
        way = small_move(pose, 0).goal - pose
        assert way[0] == pytest.approx(sign * math.radians(2.0))
        assert np.count_nonzero(way) == 1


def test_an_axis_without_room_is_not_tested(monkeypatch: pytest.MonkeyPatch) -> None:
    def blocked(_check: LineCheck, start: FloatArray, _wanted: FloatArray) -> HoldLine:
        return HoldLine(start, start, 1.0, "floor")

    monkeypatch.setattr(LineCheck, "__call__", blocked)
    with raises_code(PreflightError, "RID-POSE-OUTSIDE", "axis1"):
        small_move(pose_with_fraction(0, 0.5), 0)


def axis_test_rows(
    moved_rad: float, *, told_rad: float | None = None, valid: int = 1
) -> NDArray[Any]:
    """Return rows in which axis 2 rests, moves by `moved_rad` and rests.

    The set-points move by `told_rad`, or by `moved_rad` if it is None. `valid` is the validity of
    axis 2 in 20 rows of the motion.
    """
    count = 200
    commanded_rad = moved_rad if told_rad is None else told_rad
    found = np.zeros(count, dtype=row_dtype(N))
    progress = np.clip((np.arange(count) - 50) / 100.0, 0.0, 1.0)
    found["time_s"] = 1.0 + CYCLE_S * np.arange(count)
    found["valid"] = 1
    found["target_position"][:, 1] = 0.3 + commanded_rad * progress
    found["target_velocity"][50:150, 1] = commanded_rad / (100 * CYCLE_S)
    found["velocity_command"][50:150, 1] = commanded_rad / (100 * CYCLE_S)
    found["position"][:, 1] = 0.3 + moved_rad * progress
    revs = moved_rad * progress * ROBOT.joints[1].gear_ratio / (2.0 * math.pi)
    found["position_counts"][:, 1] = np.rint(PER_REV * revs)
    found["valid"][60:80, 1] = valid
    return found


def test_an_axis_motion_contains_distance_and_encoder_counts() -> None:
    moved = AxisMotion.of(axis_test_rows(math.radians(2.0)), ROBOT, 1)
    assert (moved.joint, moved.unit) == ("axis2", "°")
    assert moved.commanded == pytest.approx(2.0)
    assert moved.measured == pytest.approx(2.0)
    assert moved.command_ratio == pytest.approx(1.0)
    assert moved.increments_per_rev == pytest.approx(PER_REV, rel=1e-3)


@pytest.mark.parametrize(("lowest", "size"), [(0, 500_000), (-(2**31), 2**32)])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_increments_are_counted_over_a_wrap_of_the_counter(
    lowest: int, size: int, way: float
) -> None:
    rows = axis_test_rows(way * math.radians(2.0))
    counted = AxisMotion.of(rows, ROBOT, 1).counts
    start = size - 500 if way > 0.0 else 500
    shown = (rows["position_counts"][:, 1].astype(np.int64) + start) % size + lowest
    rows["position_counts"][:, 1] = shown
    assert np.abs(np.diff(shown)).max() > size // 2
    assert AxisMotion.of(rows, ROBOT, 1).counts == pytest.approx(counted, abs=1)


def test_the_command_share_shows_a_drive_that_moves_ten_times_too_far() -> None:
    moved = AxisMotion.of(axis_test_rows(math.radians(20.0), told_rad=math.radians(2.0)), ROBOT, 1)
    assert moved.commanded == pytest.approx(2.0)
    assert moved.measured == pytest.approx(20.0)
    assert moved.command_ratio == pytest.approx(0.1)


def test_rows_without_an_answer_are_ignored() -> None:
    lost = axis_test_rows(math.radians(2.0), valid=0)
    lost["position"][60:80, 1] = 99.0
    assert AxisMotion.of(lost, ROBOT, 1).measured == pytest.approx(2.0)


def test_a_stuck_encoder_is_named_if_the_axis_moved() -> None:
    dead = AxisMotion.of(axis_test_rows(0.0, told_rad=math.radians(2.0)), ROBOT, 1)
    assert dead.counts == 0
    verdict = check_axis_motion(dead, ObservedMotion("axis2", 2.0), LOADED.config, ROBOT)
    assert not verdict.passed
    assert "6064h" in verdict.sentence


def test_the_travelled_share_is_computed_from_the_set_points() -> None:
    start, goal = np.zeros(N), np.zeros(N)
    start[1], goal[1] = 0.3, 0.3 + math.radians(2.0)
    half = axis_test_rows(math.radians(2.0))[:101]
    assert travelled_fraction(HoldLine(start, goal, 1.0), half, 1) == pytest.approx(0.5)


def test_the_visible_motion_is_the_largest_one_above_a_tenth_of_a_degree() -> None:
    moved = np.zeros(N)
    moved[2], moved[1] = math.radians(-1.9), math.radians(0.2)
    visible = visible_motion(ROBOT, moved)
    assert visible.joint == "axis3"
    assert visible.amount == pytest.approx(-1.9)
    assert visible_motion(ROBOT, np.full(N, math.radians(0.09))).joint == ""


def test_q_ends_the_axis_test_before_the_next_axis(monkeypatch: pytest.MonkeyPatch) -> None:
    """The key q ends the test, although the axis has moved far enough for a verdict."""
    session = SimpleNamespace(loaded=LOADED, cell=LOADED.config, simulated=None)
    made = AxisTester(cast(RunSession, session), cast(Console, MessageLog()), unattended=True)
    ended = SimpleNamespace(outcome=SimpleNamespace(stop=None))
    run = SimpleNamespace(as_step=lambda: ended)

    def end_test(_session: object, _context: object, held: HeldRun) -> object:
        assert held.tapped("q")
        return run

    def fail_if_called(*_: object) -> None:
        raise AssertionError("the result of an ended axis test must not be read")

    monkeypatch.setattr(axis_tester, "record_held", end_test)
    monkeypatch.setattr(axis_tester, "true_position_reader", lambda _session: None)
    monkeypatch.setattr(AxisTester, "_read_rows", fail_if_called)
    assert made.test(0) is None
