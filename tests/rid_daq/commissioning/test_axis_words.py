"""Descriptions of a joint's direction that a user can compare with the visible motion."""

from __future__ import annotations

import numpy as np

from config.load import load_cell
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.robot import Joint, JointLimits, RobotDescription
from rid_daq.commissioning.axis_words import direction_words, tool_displacement

LIMITS = JointLimits(
    position_min=-3.0, position_max=3.0, velocity=1.0, acceleration=1.0, torque=1.0
)
ARM = RobotDescription(
    name="arm",
    kinematics=Kinematics(
        convention="modified_dh",
        rows=(KinematicRow(), KinematicRow(alpha_rad=-np.pi / 2.0), KinematicRow(a_m=0.5)),
    ),
    joints=(
        Joint(name="turn", limits=LIMITS),
        Joint(name="tilt", limits=LIMITS),
        Joint(name="lift", type="prismatic", limits=LIMITS),
    ),
    tool_offset_m=(0.5, 0.0, 0.0),
)
POSE = np.zeros(3)


def test_the_rotation_about_a_vertical_axis_is_described_from_above() -> None:
    words = direction_words(ARM, POSE, 0, np.deg2rad(2.0))
    assert words == (
        "turn will turn by 2° counter-clockwise, seen from above; the tool point goes 35 mm towards"
        " the base's +y"
    )
    back = direction_words(ARM, POSE, 0, -np.deg2rad(2.0))
    assert "2° clockwise, seen from above" in back
    assert "-y" in back


def test_a_completed_motion_is_described_in_the_same_terms() -> None:
    assert direction_words(ARM, POSE, 0, np.deg2rad(2.0), over=True) == (
        "turn has turned by 2° counter-clockwise, seen from above; the tool point went 35 mm"
        " towards the base's +y"
    )
    assert direction_words(ARM, POSE, 2, -0.005, over=True) == (
        "lift has moved by 5 mm towards the base's -y"
    )


def test_up_is_opposite_to_gravity() -> None:
    """The base is upside down, on a wall, or inclined."""
    turn = np.deg2rad(2.0)
    hung = ARM.model_copy(update={"gravity_m_s2": (0.0, 0.0, 9.81)})
    assert "2° clockwise, seen from above" in direction_words(hung, POSE, 0, turn)
    assert "2° counter-clockwise, seen from above" in direction_words(hung, POSE, 0, -turn)
    assert "35 mm up (the base's -z)" in direction_words(hung, POSE, 1, turn)
    on_a_wall = ARM.model_copy(update={"gravity_m_s2": (0.0, 9.81, 0.0)})
    assert direction_words(on_a_wall, POSE, 2, 0.005).endswith("5 mm down (the base's +y)")
    assert direction_words(on_a_wall, POSE, 0, turn) == (
        "turn will turn by 2° counter-clockwise, seen from the side of the base's +z; the tool"
        " point goes 35 mm down (the base's +y)"
    )
    assert "2° clockwise, seen from above" in direction_words(on_a_wall, POSE, 1, turn)
    leaning = ARM.model_copy(update={"gravity_m_s2": (0.0, 6.94, -6.94)})
    assert "seen from the side of the base's +z" in direction_words(leaning, POSE, 0, turn)


def test_a_vertical_axis_in_a_base_with_z_down_is_described_from_above() -> None:
    """Axis 1 of the arm points up, opposite to the z axis of its base."""
    robot = load_cell("ir361").robot
    words = direction_words(robot, POSE, 0, np.deg2rad(2.0))
    assert words == (
        "axis1 will turn by 2° counter-clockwise, seen from above; the tool point goes 27 mm"
        " towards the base's -y"
    )


def test_the_rotation_about_a_horizontal_axis_is_described_from_a_base_side() -> None:
    words = direction_words(ARM, POSE, 1, np.deg2rad(2.0))
    assert "from the side of the base's +y" in words
    assert "35 mm down (the base's -z)" in words


def test_a_linear_axis_is_described_by_its_direction() -> None:
    assert direction_words(ARM, POSE, 2, 0.005) == "lift will move by 5 mm towards the base's +y"


def test_a_tool_point_on_the_axis_is_not_mentioned() -> None:
    robot = load_cell("kr15").robot
    last = len(robot.joints) - 1
    at_the_axis = robot.model_copy(update={"tool_offset_m": (0.0, 0.0, 0.1)})
    assert np.linalg.norm(tool_displacement(at_the_axis, np.zeros(last + 1), last, 0.03)) < 1e-9
    assert "tool point" not in direction_words(at_the_axis, np.zeros(last + 1), last, 0.03)
