"""Comparison of an axis's commanded, measured and observed motion, with the line to change."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from config.cell.cell import CellConfig
from config.cell.servo_profile import ServoProfile, VelocityUnit
from config.errors import ConfigError
from config.load import load_cell
from rid_daq.commissioning.axis_motion import AxisMotion
from rid_daq.commissioning.axis_verdict import ObservedMotion, check_axis_motion, parse_amount
from tests.builders.raised_codes import raises_code

LOADED = load_cell("ir361")
MOTION = AxisMotion("axis2", "°", -2.0, -2.05, -14353, 0.9, 16384.0)


def problems(
    observed: ObservedMotion, motion: AxisMotion = MOTION, cell: CellConfig = LOADED.config
) -> str:
    return " ".join(check_axis_motion(motion, observed, cell, LOADED.robot).problems)


def with_servo(servo: ServoProfile) -> CellConfig:
    return LOADED.config.model_copy(update={"servo": servo})


def test_a_correct_axis_passes_with_its_encoder_counts() -> None:
    verdict = check_axis_motion(MOTION, ObservedMotion("axis2", -2.3), LOADED.config, LOADED.robot)
    assert verdict.passed
    assert "-14353 increments, 16384 per revolution of the motor" in verdict.sentence


def test_an_opposite_motion_means_a_wrong_direction() -> None:
    assert "axes, axis2: direction: -1 (is 1)." in problems(ObservedMotion("axis2", 2.0))


@pytest.mark.parametrize("factor", [0.1, 0.5, 2.0, 4.0])
def test_a_visible_motion_unlike_the_measured_one_means_a_wrong_gear_ratio(factor: float) -> None:
    gear = LOADED.robot.joints[1].gear_ratio / factor
    found = problems(ObservedMotion("axis2", -2.05 * factor))
    assert f"joints, axis2: gear_ratio: {gear:.4g}" in found
    assert "608Fh" in found
    assert "direction" not in found


@pytest.mark.parametrize("factor", [0.25, 4.0])
@pytest.mark.parametrize("unit", ["increments_per_s", "rpm"])
def test_an_encoder_resolution_from_the_cell_file_is_suspected_before_the_gear(
    factor: float, unit: VelocityUnit
) -> None:
    servo = ServoProfile(encoder_increments=16384.0, velocity_unit=unit)
    # a wrong resolution also scales the velocity command, except one in increments/s
    command_ratio = 1.0 if unit == "increments_per_s" else factor
    wrong = replace(MOTION, command_ratio=command_ratio)
    found = problems(ObservedMotion("axis2", -2.05 * factor), wrong, with_servo(servo))
    assert f"servo: encoder_increments: {16384 / factor:.4g} (is 16384)" in found
    assert "gear_ratio" not in found
    assert "velocity_unit" not in found


@pytest.mark.parametrize("factor", [1e-3, 0.1, 10.0, 60.0])
def test_a_wrong_velocity_unit_is_named_even_if_the_motion_was_too_short(factor: float) -> None:
    slow = replace(MOTION, measured=-0.8, command_ratio=factor)
    servo = ServoProfile(velocity_units=0.1)
    found = problems(ObservedMotion("axis2", -0.87), slow, with_servo(servo))
    assert f"velocity_units: {0.1 * factor:.4g} (is 0.1)" in found
    assert "is not in increments_per_s, correct axes, axis2, servo: velocity_unit" in found
    assert "gear_ratio" not in found
    assert "velocity loop" not in found


def test_the_velocity_unit_is_named_at_the_axis_if_it_is_there() -> None:
    slow = replace(MOTION, measured=-0.8, command_ratio=10.0)
    axes = [axis.model_copy(update={"velocity_unit": "rpm"}) for axis in LOADED.config.axes]
    cell = LOADED.config.model_copy(update={"axes": axes})
    found = problems(ObservedMotion("axis2", -0.87), slow, cell)
    assert "is not in rpm, correct axes, axis2: velocity_unit" in found


@pytest.mark.parametrize("seen", [-2.05, -0.2])
def test_no_velocity_unit_is_named_for_a_drive_that_receives_positions(seen: float) -> None:
    far = replace(MOTION, command_ratio=0.2)
    servo = ServoProfile(mode="cyclic_position")
    found = problems(ObservedMotion("axis2", seen), far, with_servo(servo))
    assert "607Ah" in found
    assert "velocity_unit" not in found


def test_two_wrong_scales_name_all_candidate_keys() -> None:
    both = replace(MOTION, command_ratio=10.0)
    found = problems(ObservedMotion("axis2", -8.0), both)
    assert all(key in found for key in ("encoder_increments", "velocity_unit", "velocity_units"))
    assert "gear_ratio" not in found


def test_a_stuck_encoder_is_named() -> None:
    dead = replace(MOTION, measured=0.0, counts=0, command_ratio=math.inf)
    assert "6064h" in problems(ObservedMotion("axis2", -2.0), dead)


def test_a_wrong_direction_and_gear_are_both_named() -> None:
    found = problems(ObservedMotion("axis2", 4.0))
    assert "direction: -1" in found
    assert "gear_ratio" in found


def test_a_motion_of_another_joint_means_a_wrong_node_id() -> None:
    assert "axes, axis3: node_id: 2 (is 3)" in problems(ObservedMotion("axis3", -2.0))


def test_counts_without_visible_motion_are_reported() -> None:
    assert "counted -14353 increments, but nothing moved" in problems(ObservedMotion(""))


def test_a_drive_faster_than_commanded_is_reported_with_its_factor() -> None:
    fast = replace(MOTION, command_ratio=0.1)
    assert "10 times as fast as commanded" in problems(ObservedMotion("axis2", -2.0), fast)


def test_a_drive_that_does_not_follow_is_reported_with_both_distances() -> None:
    stuck = replace(MOTION, measured=-0.3)
    assert "commanded -2.00°, measured by the drive -0.30°" in problems(
        ObservedMotion("axis2", -0.3), stuck
    )


@pytest.mark.parametrize(
    ("answer", "degrees"), [("2", 2.0), ("1,5", 1.5), ("4°", 4.0), ("30mm", 2.0), (" 60 mm", 4.0)]
)
def test_an_observed_distance_is_given_in_degrees_or_mm_at_the_tool_point(
    answer: str, degrees: float
) -> None:
    assert parse_amount(answer, MOTION, tool_mm=30.0) == pytest.approx(degrees)


@pytest.mark.parametrize("answer", ["", "-2", "two", "nan", "1e9", "30mm"])
def test_an_invalid_distance_is_refused(answer: str) -> None:
    with raises_code(ConfigError, "RID-AXIS-TEST-ANSWER"):
        parse_amount(answer, MOTION, tool_mm=0.0)
