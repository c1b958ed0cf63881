"""What was seen of an axis against what it was told: the mistake, and the line to change."""

from __future__ import annotations

from dataclasses import replace

import pytest

from config.errors import ConfigError
from config.load import load_cell
from rid_daq.commissioning.axis_motion import AxisMotion
from rid_daq.commissioning.axis_verdict import Seen, judge_axis, parse_amount

LOADED = load_cell("ir361")
MOTION = AxisMotion("axis2", "°", -2.0, -2.05, -14353, 0.9, 16384.0)


def problems(seen: Seen, motion: AxisMotion = MOTION) -> str:
    return " ".join(judge_axis(motion, seen, LOADED.config, LOADED.robot).problems)


def test_an_axis_that_does_what_it_was_told_passes_with_what_its_encoder_has() -> None:
    verdict = judge_axis(MOTION, Seen("axis2", -2.3), LOADED.config, LOADED.robot)
    assert verdict.passed
    assert "-14353 increments, 16384 a revolution of the motor" in verdict.sentence


def test_the_other_way_round_is_a_direction() -> None:
    assert "axes, axis2: direction: -1 (is 1)." in problems(Seen("axis2", 2.0))


@pytest.mark.parametrize("factor", [0.1, 0.5, 2.0, 4.0])
def test_another_angle_is_a_gear_ratio_or_an_encoder(factor: float) -> None:
    gear = LOADED.robot.joints[1].gear_ratio / factor
    found = problems(Seen("axis2", -2.0 * factor))
    assert f"joints, axis2: gear_ratio: {gear:.4g}" in found
    assert "608Fh" in found
    assert "direction" not in found


def test_both_at_once_are_both_named() -> None:
    found = problems(Seen("axis2", 4.0))
    assert "direction: -1" in found
    assert "gear_ratio" in found


def test_another_joint_is_a_node_id() -> None:
    assert "axes, axis3: node_id: 2 (is 3)" in problems(Seen("axis3", -2.0))


def test_nothing_is_a_coupling_or_another_drive() -> None:
    assert "counted -14353 increments and nothing turned" in problems(Seen(""))


def test_a_drive_that_is_faster_than_it_is_told_has_another_unit() -> None:
    fast = replace(MOTION, command_share=0.1)
    assert "10 times as fast as it is told: check velocity_unit" in problems(
        Seen("axis2", -2.0), fast
    )


def test_a_drive_that_does_not_follow_is_said() -> None:
    stuck = replace(MOTION, measured=-0.3)
    assert "was told -2.00° and measured -0.30°" in problems(Seen("axis2", -2.0), stuck)


@pytest.mark.parametrize(
    ("said", "degrees"), [("2", 2.0), ("1,5", 1.5), ("4°", 4.0), ("30mm", 2.0), (" 60 mm", 4.0)]
)
def test_how_far_is_said_in_degrees_or_by_the_tool_point(said: str, degrees: float) -> None:
    assert parse_amount(said, MOTION, tool_mm=30.0) == pytest.approx(degrees)


@pytest.mark.parametrize("said", ["", "-2", "two", "nan", "1e9", "30mm"])
def test_what_is_no_distance_is_asked_again(said: str) -> None:
    with pytest.raises(ConfigError):
        parse_amount(said, MOTION, tool_mm=0.0)
