"""Which way a joint turns, in words of the robot's base: for who stands before it."""

from __future__ import annotations

import numpy as np

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain, forward, link_transforms

SMALL_M = 5e-4


def direction_words(
    robot: RobotDescription, pose: FloatArray, number: int, amount: float, *, over: bool = False
) -> str:
    """Return what a person sees of a joint that moves by `amount` [rad or m] from a pose.

    Parameters
    ----------
    robot : RobotDescription
        Its kinematics.
    pose : ndarray, shape (joints,)
        Where it stands [rad or m].
    number : int
        The joint.
    amount : float
        How far it moves.
    over : bool, optional
        Whether it has moved already.
    """
    joint = robot.joints[number]
    chain = Chain.from_description(robot)
    axis = link_transforms(chain, pose[np.newaxis])[0, number, :3, 2]
    axis = axis * np.sign(amount)
    if joint.type == "prismatic":
        moves = "has moved" if over else "will move"
        return f"{joint.name} {moves} by {1e3 * abs(amount):.3g} mm {_to(axis)}"
    tool = tool_way(robot, pose, number, amount)
    length = float(np.linalg.norm(tool))
    goes = f"; the tool point {'went' if over else 'goes'} {1e3 * length:.0f} mm {_to(tool)}"
    return (
        f"{joint.name} {'has turned' if over else 'will turn'} by"
        f" {np.degrees(abs(amount)):.3g}° {_seen(axis)}{'' if length < SMALL_M else goes}"
    )


def tool_way(robot: RobotDescription, pose: FloatArray, number: int, amount: float) -> FloatArray:
    """Return how the tool point goes where a joint moves by `amount`, (3,) [m]."""
    there = pose.copy()
    there[number] += amount
    ends = forward(Chain.from_description(robot), np.stack([pose, there]))
    return np.asarray(ends[1] - ends[0])


def _named(direction: FloatArray) -> tuple[str, int]:
    """Return the base's axis that a direction is nearest to, and the sign."""
    number = int(np.argmax(np.abs(direction)))
    return "xyz"[number], 1 if direction[number] >= 0.0 else -1


def _to(direction: FloatArray) -> str:
    name, sign = _named(direction)
    if name == "z":
        return "up (the base's +z)" if sign > 0 else "down (the base's -z)"
    return f"towards the base's {'+' if sign > 0 else '-'}{name}"


def _seen(axis: FloatArray) -> str:
    """Return how a turn about an axis looks from where a person can stand."""
    name, sign = _named(axis)
    if name == "z":
        return f"{'counter-clockwise' if sign > 0 else 'clockwise'}, seen from above"
    side = "+" if sign > 0 else "-"
    return f"counter-clockwise, seen from the side of the base's {side}{name}"
