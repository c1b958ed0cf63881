"""Plate offsets, separated from the moment of gravity by turning axis 1 (thesis, 4.4)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.motion.limits import verify_limits
from acquisition.plate_zero.plate_zero import (
    PlateOffset,
    ZeroTurn,
    find_offset,
    plan_turn,
    turn_samples,
)
from acquisition.recording.plate_geometry import PlateGeometry
from config.errors import ConfigError, DataQualityError
from config.load import load_cell
from config.robot.robot import RobotDescription
from tests.builders.raised_codes import raises_code

LOADED = load_cell("ir361")
ROBOT = LOADED.robot
CYCLE_S = 0.008
OFFSET = np.array([20.0, -18.0, 5.0, 0.0, 33.0, -41.0, 7.0, 12.0])
DRIFT = np.array([0.05, -0.05, 0.02, 0.0, -0.04, 0.03, 0.01, -0.02])
MOMENT = np.array([60.0, -25.0, 0.0])


def geometry() -> PlateGeometry:
    assert LOADED.config.plate is not None
    return PlateGeometry.from_config(LOADED.config.plate)


def rotation_about(axis: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """Return the rotation matrix about a unit vector (Rodrigues' formula); `angle` is in rad."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross)


def measure(turn: ZeroTurn, noise_n: float = 0.3, seed: int = 0) -> PlateOffset:
    """Return the offset that is estimated from readings with a known offset, drift and moment."""
    random = np.random.default_rng(seed)
    samples, readings = turn_samples(ROBOT, turn, 1.0, 5.0, CYCLE_S)
    time_s = 100.0 + CYCLE_S * np.arange(len(samples), dtype=np.float64)
    reading = np.full(len(samples), -1)
    for k, rows in enumerate(readings):
        reading[rows.start : rows.stop] = k
    middle = 0.5 * (turn.first[0] + turn.second[0])
    wrench = np.zeros((len(samples), 6))
    for k, angle in enumerate(samples.position[:, 0]):
        wrench[k, 3:] = rotation_about(turn.axis, angle - middle) @ MOMENT
    end_s = time_s[reading >= 0].max()
    channels = OFFSET + np.outer(time_s - end_s, DRIFT) + geometry().channels(wrench)
    channels += noise_n * random.standard_normal(channels.shape)
    return find_offset(
        geometry(), turn, time_s, reading, channels, np.ones(channels.shape, dtype=np.bool_)
    )


def robot_with(low: float, high: float) -> RobotDescription:
    first = ROBOT.joints[0]
    limits = first.limits.model_copy(update={"position_min": low, "position_max": high})
    joints = (first.model_copy(update={"limits": limits}), *ROBOT.joints[1:])
    return ROBOT.model_copy(update={"joints": joints})


def test_the_turn_is_half_a_turn_about_the_middle_of_the_ranges() -> None:
    turn = plan_turn(ROBOT)
    assert turn.is_half
    assert turn.first.tolist() == pytest.approx([-math.pi / 2, -0.2, 0.5])
    assert turn.second.tolist() == pytest.approx([math.pi / 2, -0.2, 0.5])
    assert turn.axis.tolist() == pytest.approx([0.0, 0.0, -1.0], abs=1e-12)


def test_half_a_turn_separates_offset_and_moment_exactly_without_noise() -> None:
    turn = plan_turn(ROBOT)
    found = measure(turn, noise_n=0.0)
    np.testing.assert_allclose(found.offset_n, OFFSET, atol=1e-9)
    np.testing.assert_allclose(found.drift_n_s, DRIFT, atol=1e-11)
    expected = rotation_about(turn.axis, -math.pi / 2) @ MOMENT
    np.testing.assert_allclose(found.gravity, [0, 0, 0, *expected], atol=1e-8)


@pytest.mark.parametrize("limit", [0.6, 1.0, 1.4])
def test_a_smaller_turn_separates_them_by_the_same_equations(limit: float) -> None:
    turn = plan_turn(robot_with(-limit, limit))
    assert turn.turn_rad == pytest.approx(2 * limit - 0.04)
    found = measure(turn, noise_n=0.0)
    np.testing.assert_allclose(found.offset_n, OFFSET, atol=1e-8)
    expected = rotation_about(turn.axis, -turn.turn_rad / 2) @ MOMENT
    np.testing.assert_allclose(found.gravity[3:], expected, atol=1e-8)


@pytest.mark.parametrize("limit", [2.7, 0.7])
def test_the_estimate_is_within_its_reported_uncertainty(limit: float) -> None:
    turn = plan_turn(robot_with(-limit, limit))
    off, slow = [], []
    for seed in range(40):
        found = measure(turn, seed=seed)
        off.append((found.offset_n - OFFSET) / found.offset_sigma_n)
        slow.append((found.drift_n_s - DRIFT) / found.drift_sigma_n_s)
    for deviations in (np.array(off), np.array(slow)):
        assert 0.85 < float(np.sqrt(np.mean(np.square(deviations)))) < 1.15
        assert np.mean(np.abs(deviations) <= 2.0) > 0.92


def test_a_smaller_turn_is_less_certain() -> None:
    half, less = plan_turn(ROBOT), plan_turn(robot_with(-0.7, 0.7))
    assert measure(less).offset_sigma_n[4:].max() > measure(half).offset_sigma_n[4:].max()


def test_a_turn_too_small_for_the_separation_is_refused() -> None:
    with raises_code(ConfigError, "RID-PLATE-ZERO-POSE", "axis1", "44"):
        plan_turn(robot_with(-0.4, 0.4))
    with raises_code(ConfigError, "RID-PLATE-ZERO-POSE"):
        plan_turn(ROBOT, np.array([2.5, 0.0, 0.0]))


def test_a_pose_beyond_its_limits_is_refused() -> None:
    with raises_code(ConfigError, "RID-POSE-OUTSIDE", "axis2", "1.5"):
        plan_turn(ROBOT, np.array([0.0, 1.5, 0.0]))
    with raises_code(ConfigError, "RID-MOTION-JOINTS"):
        plan_turn(ROBOT, np.array([0.0, 0.0]))


def test_an_axis_that_is_not_vertical_is_refused() -> None:
    tilted = ROBOT.model_copy(update={"gravity_m_s2": (0.0, 9.81, 0.0)})
    with raises_code(ConfigError, "RID-PLATE-ZERO-AXIS"):
        plan_turn(tilted)
    weightless = ROBOT.model_copy(update={"gravity_m_s2": (0.0, 0.0, 0.0)})
    with raises_code(ConfigError, "RID-PLATE-ZERO-AXIS"):
        plan_turn(weightless)


def test_the_motion_is_within_the_limits_and_at_rest_during_readings() -> None:
    turn = plan_turn(ROBOT)
    samples, readings = turn_samples(ROBOT, turn, 1.0, 2.0, CYCLE_S)
    verify_limits(samples, ROBOT)
    poses = (turn.first, turn.second, turn.first)
    for rows, pose in zip(readings, poses, strict=True):
        assert len(rows) == 250
        part = slice(rows.start - 125, rows.stop)
        assert (samples.position[part] == pose).all()
        assert not samples.velocity[part].any()


def test_an_overloaded_channel_is_refused_with_its_name() -> None:
    turn = plan_turn(ROBOT)
    time_s = CYCLE_S * np.arange(3 * 500, dtype=np.float64)
    valid = np.ones((1500, 8), dtype=np.bool_)
    valid[600:, 2] = False
    reading = np.repeat([0, 1, 2], 500)
    with raises_code(DataQualityError, "RID-PLATE-CHANNEL", "fy14", "range_n"):
        find_offset(geometry(), turn, time_s, reading, np.zeros((1500, 8)), valid)


def test_a_short_reading_is_refused() -> None:
    time_s = CYCLE_S * np.arange(1500, dtype=np.float64)
    reading = np.where(np.arange(1500) < 50, 0, np.where(np.arange(1500) < 750, 1, 2))
    valid = np.ones((1500, 8), dtype=np.bool_)
    with raises_code(DataQualityError, "RID-RECORDING-SHORT"):
        find_offset(geometry(), plan_turn(ROBOT), time_s, reading, np.zeros((1500, 8)), valid)
