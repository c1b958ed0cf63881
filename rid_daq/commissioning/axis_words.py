"""Direction of a joint's motion in words (up, down, base axes), for a person at the robot."""

from __future__ import annotations

import numpy as np

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain, forward, link_transforms

SMALL_M = 5e-4
UPRIGHT = 0.9
"""Smallest cosine between the vertical and a base axis that counts as up or down (26 degrees)."""


def direction_words(
    robot: RobotDescription, pose: FloatArray, number: int, amount: float, *, over: bool = False
) -> str:
    """Return a sentence on the visible motion of a joint that moves by `amount` [rad or m].

    Args:
        robot: Robot with kinematics and gravity; gravity defines up.
        pose: Shape (joints,). Pose before the motion [rad or m].
        number: Index of the joint.
        amount: Displacement of the joint [rad or m].
        over: True if the motion is over (past tense).
    """
    joint = robot.joints[number]
    chain = Chain.from_description(robot)
    axis = link_transforms(chain, pose[np.newaxis])[0, number, :3, 2]
    axis = axis * np.sign(amount)
    if joint.type == "prismatic":
        moves = "has moved" if over else "will move"
        return (
            f"{joint.name} {moves} by {1e3 * abs(amount):.3g} mm {_direction_phrase(robot, axis)}"
        )
    tool = tool_displacement(robot, pose, number, amount)
    length = float(np.linalg.norm(tool))
    goes = (
        f"; the tool point {'went' if over else 'goes'} {1e3 * length:.0f} mm"
        f" {_direction_phrase(robot, tool)}"
    )
    return (
        f"{joint.name} {'has turned' if over else 'will turn'} by {np.degrees(abs(amount)):.3g}°"
        f" {_rotation_words(robot, axis)}{'' if length < SMALL_M else goes}"
    )


def tool_displacement(
    robot: RobotDescription, pose: FloatArray, number: int, amount: float
) -> FloatArray:
    """Return the displacement of the tool point if a joint moves by `amount`, (3,) [m]."""
    moved = pose.copy()
    moved[number] += amount
    ends = forward(Chain.from_description(robot), np.stack([pose, moved]))
    return np.asarray(ends[1] - ends[0])


def _nearest_base_axis(robot: RobotDescription, direction: FloatArray) -> tuple[str, int]:
    """Return the base axis nearest to a direction, and 1 if it points up, -1 if down, else 0."""
    number = int(np.argmax(np.abs(direction)))
    side = 1 if direction[number] >= 0.0 else -1
    gravity = np.array(robot.gravity_m_s2)
    upwards = -side * gravity[number] / np.linalg.norm(gravity)
    upright = 0 if abs(upwards) < UPRIGHT else int(np.sign(upwards))
    return f"{'+' if side > 0 else '-'}{'xyz'[number]}", upright


def _direction_phrase(robot: RobotDescription, direction: FloatArray) -> str:
    name, upright = _nearest_base_axis(robot, direction)
    if upright:
        return f"{'up' if upright > 0 else 'down'} (the base's {name})"
    return f"towards the base's {name}"


def _rotation_words(robot: RobotDescription, axis: FloatArray) -> str:
    """Return the sense of rotation about an axis, as seen from above or from a side."""
    name, upright = _nearest_base_axis(robot, axis)
    if upright:
        return f"{'counter-clockwise' if upright > 0 else 'clockwise'}, seen from above"
    return f"counter-clockwise, seen from the side of the base's {name}"
