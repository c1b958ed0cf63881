"""Motor positions that include the gear deflections which the planned motion requires."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.motion.kinds.circle import CircleMotion
from acquisition.motion.samples import MotionSamples, Phase
from compensation.feedforward.file import feedforward_bytes, feedforward_content
from compensation.feedforward.motor_reference import (
    BAND_HZ,
    MotorReference,
    gear_deflection,
    motor_reference,
)
from config.errors import ConfigError
from config.load import load_cell
from config.robot.robot import RobotDescription
from identification.elasticity.gear_torque import has_stiffness
from identification.elasticity.transmitted_torque import transmitted_torque
from identification.estimation.estimate import Estimate
from tests.builders.known_model import known_estimate
from tests.builders.raised_codes import raises_code

CELL, STEP_S = load_cell("ir361"), 0.008
STIFFNESS, DAMPING = np.array([5e4, 6e4, 2e4]), np.array([100.0, 0.0, 25.0])
CIRCLE = CircleMotion(
    kind="circle",
    robot="ir361",
    centre_m=(0.575, -0.078, -1.724),
    radius_m=0.2,
    speed_m_s=0.6,
    near=(0.1, -0.1, 0.4),
    periods=2,
)


def robot_with(*stiffness: float | None) -> RobotDescription:
    joints = tuple(
        joint.model_copy(update={"stiffness_nm_rad": k, "damping_nm_s": None if k is None else d})
        for joint, k, d in zip(CELL.robot.joints, stiffness, DAMPING.tolist(), strict=True)
    )
    return CELL.robot.model_copy(update={"joints": joints})


@pytest.fixture(scope="module")
def estimate() -> Estimate:
    return known_estimate(CELL, {})


@pytest.fixture(scope="module")
def planned() -> MotionSamples:
    return CIRCLE.plan(CELL.robot, STEP_S).whole()


@pytest.fixture(scope="module")
def reference(estimate: Estimate, planned: MotionSamples) -> MotorReference:
    return motor_reference(planned, estimate, robot_with(*STIFFNESS))


def test_springs_and_dampers_transmit_the_torque_of_the_links(
    reference: MotorReference, estimate: Estimate, planned: MotionSamples
) -> None:
    """The derivatives of the deflection are computed by differences in the last period."""
    rows = slice(-700, -500)
    motion = (planned.position, planned.velocity, planned.acceleration)
    wanted = transmitted_torque(estimate, CELL.robot, *motion)
    turning = np.gradient(reference.deflection, STEP_S, axis=0)
    transmitted = STIFFNESS * reference.deflection + DAMPING * turning
    assert np.abs(transmitted - wanted)[rows].max() < 0.01 * np.abs(wanted).max()


def test_velocity_and_acceleration_are_the_derivatives_of_the_position(
    reference: MotorReference,
) -> None:
    samples = reference.samples
    for value, slope in (
        (samples.position, samples.velocity),
        (samples.velocity, samples.acceleration),
    ):
        found = np.gradient(value, STEP_S, axis=0)[1:-1]
        assert np.abs(found - slope[1:-1]).max() < 0.02 * np.abs(slope).max()


def test_all_periods_are_equal(reference: MotorReference) -> None:
    rows = reference.samples.samples_per_period
    assert rows is not None
    last = int(np.flatnonzero(reference.samples.phase == Phase.MAIN)[-1]) + 1
    one, other = (reference.deflection[last - k * rows : last - (k - 1) * rows] for k in (1, 2))
    assert one[:-60] == pytest.approx(other[:-60], abs=1e-7)


def test_a_gear_of_unknown_stiffness_counts_as_rigid(
    estimate: Estimate, planned: MotionSamples
) -> None:
    robot = robot_with(None, 6e4, None)
    assert has_stiffness(robot)
    assert not has_stiffness(CELL.robot)
    bent = motor_reference(planned, estimate, robot).deflection
    assert np.abs(bent[:, [0, 2]]).max() == 0.0
    assert np.abs(bent[:, 1]).max() > 1e-4


def test_noise_above_the_band_does_not_reach_the_motors() -> None:
    time = STEP_S * np.arange(1250, dtype=np.float64)
    fast, slow = np.sin(2.0 * np.pi * 30.0 * time), np.sin(2.0 * np.pi * 5.0 * time)
    robot = robot_with(*STIFFNESS)
    assert BAND_HZ < 30.0
    assert np.abs(gear_deflection(robot, np.tile(fast[:, np.newaxis], 3), STEP_S)[0]).max() < 1e-12
    passed = gear_deflection(robot, np.tile(slow[:, np.newaxis], 3), STEP_S)[0]
    assert passed[:, 1] == pytest.approx(slow / STIFFNESS[1], abs=1e-9)


def test_a_motor_inertia_of_the_robot_file_is_not_transmitted(
    estimate: Estimate, planned: MotionSamples
) -> None:
    """The model cannot separate the motor inertia of axis 1 from its link inertia.

    For axis 3 it can.
    """
    motion = (planned.position, planned.velocity, planned.acceleration)
    joints = tuple(
        joint.model_copy(update={"motor_inertia_kg_m2": 7.0}) for joint in CELL.robot.joints
    )
    stated = CELL.robot.model_copy(update={"joints": joints})
    less = transmitted_torque(estimate, CELL.robot, *motion)
    less = less - transmitted_torque(estimate, stated, *motion)
    assert less[:, 0] == pytest.approx(7.0 * planned.acceleration[:, 0])
    assert np.abs(less[:, 2]).max() == 0.0


def test_the_file_returns_the_motors_motion(
    reference: MotorReference, planned: MotionSamples
) -> None:
    driven = replace(reference.samples, feedforward=reference.samples.velocity)
    file = feedforward_content(
        feedforward_bytes(CIRCLE, driven, None, reference.deflection), Path("ahead.json")
    )
    read = file.onto(planned)
    assert read.position == pytest.approx(reference.samples.position, abs=1e-9)
    assert np.abs(read.velocity - reference.samples.velocity).max() < 1e-3
    short = file.model_copy(update={"deflection": (file.deflection or ())[:-1]})
    with raises_code(ConfigError, "RID-FEEDFORWARD-OTHER-MOTION"):
        short.onto(planned)
