"""Last known pose of a robot: too large displacements are refused, with a text that names the
joints.
"""

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


def displaced(joint: int, moved: float) -> list[float]:
    position = list(SEEN.position)
    position[joint] += moved
    return position


def test_a_robot_at_its_last_known_pose_is_not_displaced() -> None:
    assert SEEN.displacements(ROBOT, SEEN.position) == []
    assert SEEN.refuse_moved(ROBOT, SEEN.position) == ""


@given(st.integers(0, N - 1), st.sampled_from([-2, -1, 1, 2]))
def test_a_lost_motor_turn_is_detected_and_named(joint: int, turns: int) -> None:
    turn = 2.0 * math.pi / abs(ROBOT.joints[joint].gear_ratio)
    (phrase,) = SEEN.displacements(ROBOT, displaced(joint, turns * turn))
    assert phrase.startswith(f"{ROBOT.joints[joint].name} by {math.degrees(turns * turn):.2f}°")
    assert f"({abs(turns)} whole motor turn" in phrase


@given(st.integers(0, N - 1), st.floats(0.0, 0.99))
def test_a_displacement_below_the_limit_is_accepted(joint: int, share: float) -> None:
    moved = share * displacement_limit(ROBOT.joints[joint])
    assert SEEN.displacements(ROBOT, displaced(joint, moved)) == []


def test_a_displaced_joint_is_refused_with_the_option_to_accept_it() -> None:
    with pytest.raises(PreflightError) as refused:
        SEEN.refuse_moved(ROBOT, displaced(1, 0.3))
    assert refused.value.refusal == "RID-POSE-MOVED"
    assert "--accept-pose" in str(refused.value)
    assert "whole motor turn" not in str(refused.value)


def test_the_text_names_three_of_many_displaced_joints() -> None:
    moved = SEEN.displacements(ROBOT, np.zeros(N).tolist())
    assert len(moved) == N
    assert f"and {N - 3} more" in SEEN.sentence(moved)
