"""Stribeck friction is taken beside memory where a joint has it, not where it only gives way."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from identification.validation.friction_selection import CLASSICAL, choose_friction
from identification.validation.friction_trials import with_friction
from identification.validation.presliding_choice import choose_presliding
from identification.validation.stribeck_choice import choose_stribeck
from tests.builders.remembering_arm import arm, iwan, motion, recording, with_presliding

DISTANCE = 0.02
SPEED = 0.1
WAY = motion(40.0, 1)
STRIBECK = (*CLASSICAL, "stribeck")


def remembering(larger_at_low_speed: tuple[int, ...]) -> SmoothedSignals:
    """Return a recording whose axes 2 and 3 remember; some hold half more at low speed."""
    q, v = WAY[:2]
    directions: Mapping[int, FloatArray] = {
        j: iwan(q[:, j], DISTANCE)
        * (1.0 + 0.5 * np.exp(-np.abs(v[:, j]) / SPEED) * (j in larger_at_low_speed))
        for j in (1, 2)
    }
    return recording(directions, WAY)


def has(robot: RobotDescription, term: str) -> list[bool]:
    return [term in joint.friction for joint in robot.joints]


def test_a_joint_gets_both_where_it_has_both() -> None:
    measured = [remembering((1,))]
    robot = with_presliding((1, 2), DISTANCE)
    choice = choose_stribeck(robot, measured)
    assert choice is not None
    first, second, third = choice.speeds
    assert (first, third) == (None, None)
    assert second == pytest.approx(SPEED, rel=0.3)
    without, with_it = choice.error_nm
    assert with_it[1] < 0.9 * without[1]
    robot = choice.robot(robot)
    assert has(robot, "stribeck") == [False, True, False]
    assert robot.joints[1].stribeck_velocity == second
    assert choice.robot(robot) == robot


def test_what_gives_way_at_reversals_is_memory_whatever_was_chosen_before() -> None:
    measured = [remembering(())]
    mistaken = with_friction(arm(), [CLASSICAL, STRIBECK, STRIBECK])
    memory = choose_presliding(mistaken, measured)
    assert [distance is not None for distance in memory.distances] == [False, True, True]
    choice = choose_stribeck(memory.robot(mistaken), measured)
    assert choice is not None
    robot = choice.robot(memory.robot(mistaken))
    assert (has(robot, "stribeck"), has(robot, "presliding")) == ([False] * 3, [False, True, True])


def test_friction_that_falls_towards_rest_is_no_stribeck_friction() -> None:
    """What a term below zero fits gives way, or was low-passed: at rest it would hold nothing."""
    v = WAY[1][:, 1]
    falling = np.sign(v) * (1.0 - 0.8 * np.exp(-np.abs(v) / SPEED))
    found = choose_friction(arm(), [recording({1: falling}, WAY)], candidates=[CLASSICAL, STRIBECK])
    plain, slow = found.trials
    assert slow.error_nm[1] < 0.7 * plain.error_nm[1], "nothing to be tempted by"
    assert found.chosen == (CLASSICAL,) * 3


def test_joints_without_either_are_not_tried() -> None:
    assert choose_stribeck(arm(), [recording({}, WAY)]) is None
