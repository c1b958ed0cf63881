"""The pose in which a robot was seen last: which changes count, and how they are named."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.motion.known_pose import KnownPose, displacement_limit
from config.errors import PreflightError
from config.load import load_cell

ROBOT = load_cell("kr15").robot
N = len(ROBOT.joints)
SEEN = KnownPose((0.1,) * N, "run A")


def stands(joint: int, moved: float) -> list[float]:
    position = list(SEEN.position)
    position[joint] += moved
    return position


def test_where_it_was_seen_nothing_is_displaced() -> None:
    assert SEEN.displacements(ROBOT, SEEN.position) == []
    assert SEEN.refuse_moved(ROBOT, SEEN.position) == ""


@given(st.integers(0, N - 1), st.sampled_from([-2, -1, 1, 2]))
def test_a_lost_turn_of_any_motor_is_seen_and_named(joint: int, turns: int) -> None:
    turn = 2.0 * math.pi / abs(ROBOT.joints[joint].gear_ratio)
    (phrase,) = SEEN.displacements(ROBOT, stands(joint, turns * turn))
    assert phrase.startswith(f"{ROBOT.joints[joint].name} by {math.degrees(turns * turn):.2f}°")
    assert f"({abs(turns)} whole motor turn" in phrase


@given(st.integers(0, N - 1), st.floats(0.0, 0.99))
def test_less_than_the_limit_is_a_brake_that_gave(joint: int, share: float) -> None:
    moved = share * displacement_limit(ROBOT.joints[joint])
    assert SEEN.displacements(ROBOT, stands(joint, moved)) == []


def test_a_joint_that_was_moved_by_hand_is_refused_with_what_to_do() -> None:
    with pytest.raises(PreflightError) as refused:
        SEEN.refuse_moved(ROBOT, stands(1, 0.3))
    assert refused.value.refusal == "RID-POSE-MOVED"
    assert "--accept-pose" in str(refused.value)
    assert "whole motor turn" not in str(refused.value)


def test_of_many_joints_three_are_named() -> None:
    moved = SEEN.displacements(ROBOT, np.zeros(N).tolist())
    assert len(moved) == N
    assert f"and {N - 3} more" in SEEN.sentence(moved)
