from __future__ import annotations

import math

import pytest

from acquisition.task.position_loop import PositionLoop
from config.cell.cell import CellConfig
from config.errors import ConfigError
from config.robot.robot import RobotDescription
from tests.builders.raised_codes import raises_code

LOOP = PositionLoop(gain_per_s=10.0, velocity_limit=(2.0, 3.0))


def test_the_command_is_the_gain_times_the_error_plus_the_feedforward() -> None:
    command = LOOP.velocity_command([1.0, -0.5], [0.2, -0.1], [0.95, -0.4])
    assert command == pytest.approx([10.0 * 0.05 + 0.2, -10.0 * 0.1 - 0.1])


def test_the_command_stays_within_the_limits() -> None:
    assert LOOP.velocity_command([9.0, -9.0], [0.0, 0.0], [0.0, 0.0]) == [2.0, -3.0]


def test_a_set_point_that_is_not_a_number_gives_a_command_that_is_not_a_number() -> None:
    assert math.isnan(LOOP.velocity_command([math.nan, 0.0], [0.0, 0.0], [0.0, 0.0])[0])


def test_the_limits_are_those_of_the_robot_with_the_margin_of_the_cell(
    cell: CellConfig, robot: RobotDescription
) -> None:
    loop = PositionLoop.of_cell(cell, robot)
    assert loop.gain_per_s == cell.position_gain_per_s
    assert loop.velocity_limit == pytest.approx((2.2, 2.2, 2.2))


@pytest.mark.parametrize("gain", [0.0, -1.0, math.nan, math.inf])
def test_a_gain_must_be_positive(gain: float) -> None:
    with raises_code(ConfigError, "RID-CELL-VALUE", "gain_per_s"):
        PositionLoop(gain, (1.0,))
