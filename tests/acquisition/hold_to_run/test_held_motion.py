"""Set-points of a hold-to-run motion, cycle by cycle, on a simulated clock."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from acquisition.hold_to_run.dead_man import DEAD_MAN_S, DeadMan
from acquisition.hold_to_run.held_motion import IDLE_S, HeldMotion
from acquisition.hold_to_run.line import HoldLine
from acquisition.motion.stop_distance import ORDERED_STOP_CYCLES, stop_travel
from config.cell.cell import CanBusConfig, CellConfig, DriveAxis
from config.cell.drive_safety import DriveSafety
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.robot import Joint, JointLimits, RobotDescription

T = 0.008
SPEED, ACCELERATION = 2.0, 10.0
ROBOT = RobotDescription(
    name="arm",
    kinematics=Kinematics(convention="modified_dh", rows=(KinematicRow(),) * 2),
    joints=tuple(
        Joint(
            name=name,
            limits=JointLimits(
                position_min=-2.0,
                position_max=2.0,
                velocity=SPEED,
                acceleration=ACCELERATION,
                torque=10.0,
            ),
        )
        for name in ("one", "two")
    ),
)
START = np.array([0.3, -0.2])
CELL = CellConfig(
    name="arm",
    robot="arm",
    cycle_time_ms=8,
    can=CanBusConfig(interface="virtual", channel="arm"),
    axes=tuple(DriveAxis(joint=each.name, node_id=i) for i, each in enumerate(ROBOT.joints, 1)),
    position_gain_per_s=10.0,
    drive_safety=DriveSafety(quick_stop_deceleration_rad_s2=8.0, following_error_rad=0.1),
)


class Bench:
    """A hold-to-run motion on a simulated clock, and its set-points so far."""

    def __init__(
        self,
        *,
        once: bool = False,
        unattended: bool = False,
        cell: CellConfig = CELL,
        robot: RobotDescription = ROBOT,
    ) -> None:
        self.now_s = 100.0
        self.dead_man = DeadMan.create()
        self.motion = HeldMotion(
            cell, robot, self.dead_man, once=once, unattended=unattended, now_s=lambda: self.now_s
        )
        self.motion.prepare()
        self.motion.begin(False, START)
        self.row = 0
        self.positions: list[list[float]] = []
        self.velocities: list[list[float]] = []

    def run_cycles(self, count: int, *, held: bool) -> bool:
        """Run cycles with the key held or not; return False if the motion has ended."""
        for _ in range(count):
            if held:
                self.dead_man.hold(self.now_s + DEAD_MAN_S)
            point = self.motion.at(self.row)
            self.row += 1
            self.now_s += T
            if point is None:
                return False
            self.positions.append(point.position)
            self.velocities.append(point.velocity)
        return True

    def press(self, goal: NDArray[np.float64], pace: float = 1.0) -> None:
        pose = self.dead_man.rest_pose(2)
        assert pose is not None
        self.dead_man.press(HoldLine(pose, goal, pace), self.now_s + DEAD_MAN_S)

    @property
    def speed(self) -> float:
        return float(np.abs(self.velocities[-1]).max())


GOAL = START + np.array([0.5, 0.0])


def test_nothing_moves_before_a_key_is_held() -> None:
    bench = Bench()
    bench.run_cycles(50, held=False)
    np.testing.assert_array_equal(bench.positions, np.tile(START, (50, 1)))


def test_while_the_key_is_held_the_robot_moves_to_the_end_of_the_line_and_rests() -> None:
    bench = Bench()
    bench.run_cycles(1, held=False)
    bench.press(GOAL, pace=0.4)
    bench.run_cycles(400, held=True)
    np.testing.assert_array_equal(bench.positions[-1], GOAL)
    assert bench.speed == 0.0
    assert np.abs(bench.velocities).max() == pytest.approx(0.4 * 0.5)
    assert bench.dead_man.rest_pose(2) is not None


def test_the_robot_slows_down_in_the_first_cycle_after_the_release() -> None:
    bench = Bench()
    bench.run_cycles(1, held=False)
    bench.press(GOAL, pace=0.4)
    bench.run_cycles(60, held=True)
    before = bench.speed
    assert before == pytest.approx(0.2)
    bench.dead_man.release()
    bench.run_cycles(1, held=False)
    assert bench.speed == pytest.approx(before - 0.3 * ACCELERATION * T)


@pytest.mark.parametrize("coupling", [None, ((1.0, 0.0), (0.5, 1.0))])
@pytest.mark.parametrize("held", [True, False])
def test_a_quick_stop_anywhere_on_a_line_ends_before_its_goal(
    held: bool, coupling: tuple[tuple[float, float], ...] | None
) -> None:
    """The drives' quick stop decelerates more slowly than the motion brakes."""
    safety = CELL.drive_safety.model_copy(update={"quick_stop_deceleration_rad_s2": 0.3})
    cell = CELL.model_copy(update={"drive_safety": safety})
    robot = ROBOT.model_copy(update={"coupling": coupling})
    bench = Bench(cell=cell, robot=robot)
    bench.run_cycles(1, held=False)
    bench.press(GOAL)
    bench.run_cycles(200, held=True)
    if not held:
        bench.dead_man.release()
    bench.run_cycles(400, held=held)
    assert bench.speed == 0.0
    velocities = np.array(bench.velocities)
    assert velocities[:, 0].max() == pytest.approx(0.1 * SPEED)
    travel = stop_travel(velocities, cell, robot, ORDERED_STOP_CYCLES * T)
    assert (np.array(bench.positions) + travel)[:, 0].max() <= GOAL[0] + 1e-3


def test_without_key_messages_the_robot_slows_down_after_the_dead_man_time() -> None:
    bench = Bench()
    bench.run_cycles(1, held=False)
    bench.press(GOAL, pace=0.4)
    bench.run_cycles(60, held=True)
    last_sign_s = bench.now_s - T
    while bench.now_s < last_sign_s + DEAD_MAN_S:
        bench.run_cycles(1, held=False)
        assert bench.speed == pytest.approx(0.2)
    bench.run_cycles(1, held=False)
    assert bench.speed < 0.2
    assert bench.dead_man.rest_pose(2) is None
    bench.run_cycles(20, held=False)
    assert bench.speed == 0.0


def test_after_a_release_the_robot_moves_only_with_a_new_press() -> None:
    bench = Bench()
    bench.run_cycles(1, held=False)
    bench.press(GOAL)
    bench.run_cycles(20, held=True)
    bench.dead_man.release()
    bench.run_cycles(1, held=False)
    bench.run_cycles(60, held=True)
    stood = bench.positions[-1]
    assert bench.speed == 0.0
    assert stood[0] < GOAL[0]
    bench.press(GOAL)
    bench.run_cycles(10, held=True)
    assert bench.positions[-1][0] > stood[0]


def test_a_hold_time_too_far_in_the_future_is_ignored() -> None:
    bench = Bench()
    bench.run_cycles(1, held=False)
    bench.press(GOAL)
    bench.dead_man.hold(bench.now_s + 1e6)
    bench.run_cycles(20, held=False)
    np.testing.assert_array_equal(bench.positions[-1], START)


def test_a_press_that_expired_before_the_first_cycle_moves_nothing() -> None:
    bench = Bench()
    bench.run_cycles(1, held=False)
    bench.press(GOAL)
    bench.now_s += 2.0 * DEAD_MAN_S
    bench.run_cycles(5, held=False)
    np.testing.assert_array_equal(bench.positions[-1], START)
    assert bench.dead_man.rest_pose(2) is not None


@pytest.mark.parametrize("released", [True, False])
def test_a_motion_of_one_press_ends_with_the_press(released: bool) -> None:
    bench = Bench(once=True)
    bench.run_cycles(1, held=False)
    bench.press(GOAL)
    bench.run_cycles(20, held=True)
    assert not bench.run_cycles(1000, held=not released)
    assert bench.speed == 0.0


def test_a_finished_motion_ends_although_the_key_is_held() -> None:
    bench = Bench()
    bench.run_cycles(1, held=False)
    bench.press(GOAL)
    bench.run_cycles(20, held=True)
    bench.dead_man.finish()
    assert not bench.run_cycles(1000, held=True)
    assert bench.positions[-1][0] < GOAL[0]


def test_a_motion_without_a_held_key_ends_after_the_idle_time() -> None:
    bench = Bench()
    assert not bench.run_cycles(round(IDLE_S / T) + 2, held=False)
    assert "60 s" in bench.motion.notes[0]


def test_an_unattended_press_continues_to_the_end_of_its_line() -> None:
    bench = Bench(once=True, unattended=True)
    bench.run_cycles(1, held=False)
    bench.press(GOAL)
    assert not bench.run_cycles(1000, held=False)
    np.testing.assert_array_equal(bench.positions[-1], GOAL)


@settings(max_examples=60)
@given(
    goals=st.lists(
        st.tuples(st.floats(-1.9, 1.9), st.floats(-1.9, 1.9), st.floats(0.01, 50.0)), max_size=4
    ),
    holds=st.lists(st.tuples(st.booleans(), st.integers(1, 60)), min_size=1, max_size=12),
)
def test_speed_and_acceleration_stay_reduced_for_any_presses_and_releases(
    goals: list[tuple[float, float, float]], holds: list[tuple[bool, int]]
) -> None:
    bench = Bench()
    bench.run_cycles(1, held=False)
    waiting = list(goals)
    for held, count in holds:
        if held and waiting and bench.dead_man.rest_pose(2) is not None:
            *goal, pace = waiting.pop()
            bench.press(np.array(goal), pace)
        bench.run_cycles(count, held=held)
        if not held:
            bench.dead_man.release()
    bench.run_cycles(300, held=False)
    assert bench.speed == 0.0
    positions, velocities = np.array(bench.positions), np.array(bench.velocities)
    assert (np.abs(velocities) <= 0.3 * SPEED * (1.0 + 1e-9)).all()
    slope = np.diff(velocities, axis=0) / T
    assert (np.abs(slope) <= 0.3 * ACCELERATION * (1.0 + 1e-6)).all()
    assert (np.abs(np.diff(positions, axis=0)) <= 0.31 * SPEED * T).all()


@pytest.mark.promise("ranges-everywhere")
@pytest.mark.parametrize(
    ("goal", "pace"),
    [
        (GOAL, np.nan),
        (GOAL, -1.0),
        (GOAL, 0.0),
        (np.array([np.nan, 0.0]), 1.0),
        (np.array([np.inf, 0.0]), 1.0),
        (np.array([2.001, -0.2]), 1.0),
    ],
)
def test_an_invalid_goal_or_pace_moves_nothing(goal: NDArray[np.float64], pace: float) -> None:
    bench = Bench()
    bench.run_cycles(1, held=False)
    bench.press(goal, pace=pace)
    bench.run_cycles(50, held=True)
    np.testing.assert_array_equal(bench.positions, np.tile(START, (51, 1)))


@pytest.mark.promise("ranges-everywhere")
def test_any_pace_is_limited_to_a_tenth_of_the_speed_limit() -> None:
    bench = Bench()
    bench.run_cycles(1, held=False)
    bench.press(START + np.array([1.5, 0.0]), pace=1e6)
    bench.run_cycles(200, held=True)
    assert np.abs(bench.velocities).max() == pytest.approx(0.1 * SPEED)
