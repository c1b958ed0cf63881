"""Straight motion under a held key: within limits, without collision, at a reduced speed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from acquisition.hold_to_run.line import FASTEST_SHARE, REDUCED_SPEED_M_S, STEP, LineCheck
from config.errors import ConfigError
from config.load import load_cell
from config.robot.bodies import Plane, Workspace
from dynamics.geometry.kinematics import Chain, forward

LOADED = load_cell("ir361")
REST = np.zeros(3)


def check(*planes: Plane, speed_share: float = 0.02) -> LineCheck:
    cell = LOADED.config.model_copy(update={"workspace": Workspace(planes=planes)})
    return LineCheck(cell, LOADED.robot, speed_share)


def wall_ahead() -> Plane:
    """Return a wall 5 cm from the tool's rest position, to which axis1 moves the tool."""
    tool = forward(
        Chain.from_description(LOADED.robot), np.array([REST, REST + np.array([0.3, 0.0, 0.0])])
    )
    way = tool[1] - tool[0]
    normal = tuple(-way / np.linalg.norm(way))
    return Plane(name="the wall", normal=normal, offset_m=float(np.dot(normal, tool[0])) - 0.05)


def test_a_short_line_is_driven_to_its_end_at_the_requested_share_of_the_speed() -> None:
    goal = REST + np.array([0.0, 0.0, 0.035])
    line = check()(REST, goal)
    np.testing.assert_array_equal(line.goal, goal)
    assert line.obstacle == ""
    assert line.pace_per_s * 0.035 == pytest.approx(0.02 * LOADED.robot.joints[2].limits.velocity)


def test_a_line_ends_before_a_joint_limit() -> None:
    high = LOADED.robot.joints[0].limits.position_max
    line = check()(REST, REST + np.array([10.0, 0.0, 0.0]))
    assert high - 0.02 < line.goal[0] < high
    assert line.obstacle == "the limit of axis1"


def test_a_line_ends_before_a_wall_and_can_lead_away_from_it() -> None:
    lines = check(wall_ahead())
    to_the_wall = lines(REST, REST + np.array([1.0, 0.0, 0.0]))
    assert "the wall" in to_the_wall.obstacle
    assert 0.0 < to_the_wall.goal[0] < 0.2
    away = lines(to_the_wall.goal, REST - np.array([0.5, 0.0, 0.0]))
    assert away.goal[0] == pytest.approx(-0.5)


def test_many_presses_do_not_bring_the_robot_closer_than_the_clearance() -> None:
    lines = check(wall_ahead())
    at = lines(REST, REST + np.array([1.0, 0.0, 0.0])).goal
    begin = at[0]
    for _ in range(100):
        at = lines(at, at + np.array([5e-4, 0.0, 0.0])).goal
    assert at[0] - begin < STEP


def test_the_tool_point_stays_within_the_reduced_speed() -> None:
    line = check(speed_share=FASTEST_SHARE)(REST, REST + np.array([1.0, 0.0, 0.0]))
    ends = forward(
        Chain.from_description(LOADED.robot),
        np.array([line.start, line.start + 1e-3 * (line.goal - line.start)]),
    )
    speed = np.linalg.norm(ends[1] - ends[0]) / 1e-3 * line.pace_per_s
    assert speed <= REDUCED_SPEED_M_S * 1.001


@pytest.mark.promise("ranges-everywhere")
@pytest.mark.parametrize("share", [0.0, -0.02, 0.1001, 10.0, math.nan, math.inf])
def test_a_speed_share_above_a_tenth_of_the_limit_is_refused(share: float) -> None:
    with pytest.raises(ConfigError) as caught:
        check(speed_share=share)
    assert caught.value.refusal == "RID-OPTION-RANGE"
