"""Comparison of an axis's measured and commanded motion: the mistake, and the line to change."""

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
    seen: ObservedMotion, motion: AxisMotion = MOTION, cell: CellConfig = LOADED.config
) -> str:
    return " ".join(check_axis_motion(motion, seen, cell, LOADED.robot).problems)


def with_servo(servo: ServoProfile) -> CellConfig:
    return LOADED.config.model_copy(update={"servo": servo})


def test_an_axis_that_does_what_it_was_told_passes_with_what_its_encoder_has() -> None:
    verdict = check_axis_motion(MOTION, ObservedMotion("axis2", -2.3), LOADED.config, LOADED.robot)
    assert verdict.passed
    assert "-14353 increments, 16384 per revolution of the motor" in verdict.sentence


def test_the_other_way_round_is_a_direction() -> None:
    assert "axes, axis2: direction: -1 (is 1)." in problems(ObservedMotion("axis2", 2.0))


@pytest.mark.parametrize("factor", [0.1, 0.5, 2.0, 4.0])
def test_a_motion_that_only_the_eyes_see_otherwise_is_a_gear_ratio(factor: float) -> None:
    gear = LOADED.robot.joints[1].gear_ratio / factor
    found = problems(ObservedMotion("axis2", -2.05 * factor))
    assert f"joints, axis2: gear_ratio: {gear:.4g}" in found
    assert "608Fh" in found
    assert "direction" not in found


@pytest.mark.parametrize("factor", [0.25, 4.0])
@pytest.mark.parametrize("unit", ["increments_per_s", "rpm"])
def test_an_encoder_that_only_the_cell_file_knows_is_accused_before_the_gear(
    factor: float, unit: VelocityUnit
) -> None:
    servo = ServoProfile(encoder_increments=16384.0, velocity_unit=unit)
    # a wrong resolution scales the velocity command too, if that is not in increments
    share = 1.0 if unit == "increments_per_s" else factor
    wrong = replace(MOTION, command_share=share)
    found = problems(ObservedMotion("axis2", -2.05 * factor), wrong, with_servo(servo))
    assert f"servo: encoder_increments: {16384 / factor:.4g} (is 16384)" in found
    assert "gear_ratio" not in found
    assert "velocity_unit" not in found


@pytest.mark.parametrize("factor", [1e-3, 0.1, 10.0, 60.0])
def test_a_velocity_unit_is_named_though_the_axis_did_not_get_there(factor: float) -> None:
    slow = replace(MOTION, measured=-0.8, command_share=factor)
    servo = ServoProfile(velocity_units=0.1)
    found = problems(ObservedMotion("axis2", -0.87), slow, with_servo(servo))
    assert f"velocity_units: {0.1 * factor:.4g} (is 0.1 increments_per_s)" in found
    assert "gear_ratio" not in found
    assert "velocity loop" not in found


def test_two_wrong_scales_at_once_name_all_that_may_be_wrong() -> None:
    both = replace(MOTION, command_share=10.0)
    found = problems(ObservedMotion("axis2", -8.0), both)
    assert all(key in found for key in ("encoder_increments", "velocity_unit", "velocity_units"))
    assert "gear_ratio" not in found


def test_an_encoder_that_stands_still_is_said() -> None:
    dead = replace(MOTION, measured=0.0, counts=0, command_share=math.inf)
    assert "6064h" in problems(ObservedMotion("axis2", -2.0), dead)


def test_both_at_once_are_both_named() -> None:
    found = problems(ObservedMotion("axis2", 4.0))
    assert "direction: -1" in found
    assert "gear_ratio" in found


def test_another_joint_is_a_node_id() -> None:
    assert "axes, axis3: node_id: 2 (is 3)" in problems(ObservedMotion("axis3", -2.0))


def test_nothing_is_a_coupling_or_another_drive() -> None:
    assert "counted -14353 increments, but nothing moved" in problems(ObservedMotion(""))


def test_a_drive_that_is_faster_than_it_is_told_has_another_unit() -> None:
    fast = replace(MOTION, command_share=0.1)
    assert "10 times as fast as commanded" in problems(ObservedMotion("axis2", -2.0), fast)


def test_a_drive_that_does_not_follow_is_said() -> None:
    stuck = replace(MOTION, measured=-0.3)
    assert "commanded -2.00°, measured by its drive -0.30°" in problems(
        ObservedMotion("axis2", -0.3), stuck
    )


@pytest.mark.parametrize(
    ("said", "degrees"), [("2", 2.0), ("1,5", 1.5), ("4°", 4.0), ("30mm", 2.0), (" 60 mm", 4.0)]
)
def test_how_far_is_said_in_degrees_or_by_the_tool_point(said: str, degrees: float) -> None:
    assert parse_amount(said, MOTION, tool_mm=30.0) == pytest.approx(degrees)


@pytest.mark.parametrize("said", ["", "-2", "two", "nan", "1e9", "30mm"])
def test_what_is_no_distance_is_asked_again(said: str) -> None:
    with raises_code(ConfigError, "RID-AXIS-TEST-ANSWER"):
        parse_amount(said, MOTION, tool_mm=0.0)
