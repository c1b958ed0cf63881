"""Which way a joint turns, by up, down and the robot's base: for who stands before it."""

from __future__ import annotations

import numpy as np

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain, forward, link_transforms

SMALL_M = 5e-4
UPRIGHT = 0.9
"""Cosine to the vertical of a base axis that counts as up or down (26 degrees)."""


def direction_words(
    robot: RobotDescription, pose: FloatArray, number: int, amount: float, *, over: bool = False
) -> str:
    """Return what a person sees of a joint that moves by `amount` [rad or m] from a pose.

    Args:
        robot: Its kinematics, and gravity: that says where up is.
        pose: Shape (joints,). Where it stands [rad or m].
        number: The joint.
        amount: How far it moves.
        over: Whether it has moved already.
    """
    joint = robot.joints[number]
    chain = Chain.from_description(robot)
    axis = link_transforms(chain, pose[np.newaxis])[0, number, :3, 2]
    axis = axis * np.sign(amount)
    if joint.type == "prismatic":
        moves = "has moved" if over else "will move"
        return f"{joint.name} {moves} by {1e3 * abs(amount):.3g} mm {_to(robot, axis)}"
    tool = tool_way(robot, pose, number, amount)
    length = float(np.linalg.norm(tool))
    goes = f"; the tool point {'went' if over else 'goes'} {1e3 * length:.0f} mm {_to(robot, tool)}"
    return (
        f"{joint.name} {'has turned' if over else 'will turn'} by"
        f" {np.degrees(abs(amount)):.3g}° {_seen(robot, axis)}{'' if length < SMALL_M else goes}"
    )


def tool_way(robot: RobotDescription, pose: FloatArray, number: int, amount: float) -> FloatArray:
    """Return how the tool point goes where a joint moves by `amount`, (3,) [m]."""
    there = pose.copy()
    there[number] += amount
    ends = forward(Chain.from_description(robot), np.stack([pose, there]))
    return np.asarray(ends[1] - ends[0])


def _named(robot: RobotDescription, direction: FloatArray) -> tuple[str, int]:
    """Return the base's axis nearest to a direction, and whether it points up (1) or down (-1)."""
    number = int(np.argmax(np.abs(direction)))
    side = 1 if direction[number] >= 0.0 else -1
    gravity = np.array(robot.gravity_m_s2)
    upwards = -side * gravity[number] / np.linalg.norm(gravity)
    upright = 0 if abs(upwards) < UPRIGHT else int(np.sign(upwards))
    return f"{'+' if side > 0 else '-'}{'xyz'[number]}", upright


def _to(robot: RobotDescription, direction: FloatArray) -> str:
    name, upright = _named(robot, direction)
    if upright:
        return f"{'up' if upright > 0 else 'down'} (the base's {name})"
    return f"towards the base's {name}"


def _seen(robot: RobotDescription, axis: FloatArray) -> str:
    """Return how a turn about an axis looks from where a person can stand."""
    name, upright = _named(robot, axis)
    if upright:
        return f"{'counter-clockwise' if upright > 0 else 'clockwise'}, seen from above"
    return f"counter-clockwise, seen from the side of the base's {name}"
