"""D-optimal poses are within the limits, away from obstacles, and better than random poses."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from config.errors import ConfigError, DataQualityError
from config.load import load_cell, load_robot
from dynamics.geometry.clearances import Clearances
from identification.kinematics.calibration import nominal_arm
from identification.kinematics.gravity import Gravity
from identification.kinematics.pose_design import PoseDesign, design_poses, is_clear_between
from tests.builders.raised_codes import raises_code
from tests.identification.kinematics.conftest import Experiment

CELL = load_cell("kr15")
CLEARANCES = Clearances.of(CELL.robot, CELL.config.workspace)
POINT_M = np.array([0.12, 0.05, -0.1])
ARM = nominal_arm(CELL.robot, Gravity.of_cad(CELL.robot, POINT_M), POINT_M)


@pytest.fixture(scope="module")
def design() -> PoseDesign:
    return design_poses(ARM, CELL.robot, CLEARANCES, count=30, load_kg=13.6)


def test_half_of_the_poses_carry_the_load(design: PoseDesign) -> None:
    assert design.load_kg.tolist() == [0.0] * 15 + [13.6] * 15
    assert len(design.parameters) == 27 + 5


def test_poses_are_within_limits_torques_and_clear_of_obstacles(design: PoseDesign) -> None:
    for number, joint in enumerate(CELL.robot.joints):
        low, high = joint.limits.position_min, joint.limits.position_max
        margin = 0.05 * (high - low) - 1e-9
        assert (design.position[:, number] >= low + margin).all()
        assert (design.position[:, number] <= high - margin).all()
    torques = np.array([joint.limits.torque for joint in CELL.robot.joints])
    assert ARM.gravity is not None
    assert (np.abs(ARM.gravity.torque(design.position, design.load_kg)) <= torques).all()
    assert CLEARANCES.is_clear(design.position)


def test_the_way_between_two_stops_is_clear(design: PoseDesign) -> None:
    for rows in (design.load_kg == 0.0, design.load_kg > 0.0):
        stops = design.stops(rows, CLEARANCES)
        assert len(stops) >= 15
        for start, end in itertools.pairwise(stops):
            assert is_clear_between(CLEARANCES, start, end)


def test_the_poses_are_worth_a_quarter_more_random_ones(design: PoseDesign) -> None:
    random = np.random.default_rng(1)
    limits = [joint.limits for joint in CELL.robot.joints]
    low = np.array([each.position_min for each in limits])
    high = np.array([each.position_max for each in limits])
    position = random.uniform(low, high, (30, 6))
    slopes = ARM.slopes(position, design.load_kg, design.parameters)
    chosen = ARM.slopes(design.position, design.load_kg, design.parameters)
    size = np.linalg.norm(slopes.reshape(-1, 32), axis=0)
    log_det = [
        np.linalg.slogdet((each.reshape(-1, 32) / size).T @ (each.reshape(-1, 32) / size))[1]
        for each in (slopes, chosen)
    ]
    assert log_det[1] - log_det[0] > 32.0 * np.log(1.25)
    assert design.spread_mean < design.spread_max < 1.0


def test_the_expected_spread_is_that_of_the_calibration(three_axes: Experiment) -> None:
    robot = three_axes.arm.robot
    arm = nominal_arm(robot, three_axes.gravity, three_axes.point_m)
    found = design_poses(arm, robot, Clearances.of(robot), count=20, seed=3)
    assert np.array_equal(
        found.position, design_poses(arm, robot, Clearances.of(robot), count=20, seed=3).position
    )
    assert 0.2 < found.spread_mean < 0.8


def test_too_few_poses_are_refused() -> None:
    with raises_code(DataQualityError, "RID-KINEMATICS-FEW", "10"):
        design_poses(ARM, CELL.robot, CLEARANCES, count=10)


def test_a_load_beyond_the_torque_limits_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("identification.kinematics.pose_design.MOST_DRAWS", 50)
    with raises_code(ConfigError, "RID-DESIGN-NONE", "kr15"):
        design_poses(ARM, load_robot("kr15"), CLEARANCES, count=30, load_kg=2000.0)
