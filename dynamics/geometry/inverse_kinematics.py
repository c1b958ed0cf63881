"""Inverse kinematics of the tool point along a path, by Newton's method."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from config.arrays import FloatArray
from config.errors import ConfigError
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain, jacobian, link_transforms

ITERATIONS: Final = 50
TOLERANCE_M: Final = 1e-11
LONGEST_STEP: Final = 0.3
SINGULAR: Final = 1e-3
STEP: Final = 1e-5
STEP_M: Final = 0.05
"""Largest distance of the points on a line whose poses are computed one after the other [m]."""


def pose_near_path(
    robot: RobotDescription, near: Sequence[float]
) -> tuple[Chain, FloatArray, FloatArray | None]:
    """Return arm, pose and orientation with which the search along a path of the tool starts.

    With three joints, the orientation of the flange is free (None); with any other number, the
    flange keeps its orientation at `near`.

    Raises:
        ConfigError: `near` does not have one value per joint (RID-MOTION-JOINTS).
    """
    n = len(robot.joints)
    if len(near) != n:
        raise ConfigError(
            f"near has {len(near)} values, but robot {robot.name!r} has {n} joints: give one value"
            " per joint",
            code="RID-MOTION-JOINTS",
        )
    chain = Chain.from_description(robot)
    pose = np.array(near, dtype=float)
    rotation = None if n == 3 else link_transforms(chain, pose[np.newaxis])[0, -1][:3, :3]
    return chain, pose, rotation


def follow_tool_path(
    chain: Chain, points_m: FloatArray, near: FloatArray, rotation: FloatArray | None = None
) -> FloatArray:
    """Return joint positions along a path of the tool point, computed point by point.

    Args:
        chain: The arm.
        points_m: Shape (samples, 3). Desired tool points in the base frame [m]; consecutive points
            must be close together.
        near: Shape (n,). Joint positions with the tool near the first point; they select the arm's
            configuration, such as elbow up.
        rotation: Shape (3, 3). Orientation that the last link's frame must keep; None leaves the
            orientation free, as is necessary for an arm of three joints.

    Returns:
        Shape (samples, n). Joint positions [rad or m].

    Raises:
        ConfigError: A point cannot be reached from the previous point, or only through a singular
            pose.
    """
    found = np.empty((len(points_m), chain.n))
    pose = np.array(near, dtype=float)
    for number, point in enumerate(points_m):
        what = f"point {number + 1} of {len(points_m)} of the path"
        pose = reach(chain, point, pose, rotation, what)
        found[number] = pose
    return found


def poses_on_lines(
    robot: RobotDescription, near: Sequence[float], points_m: FloatArray
) -> tuple[tuple[float, ...], ...]:
    """Return the poses at points of the tool, each reached from the previous one along a line.

    Args:
        robot: The robot.
        near: Pose close to the first point, with the constant orientation, as in `pose_near_path`.
        points_m: Shape (points, 3). Points in the base frame [m].

    Raises:
        ConfigError: `near` does not have one value per joint, or a point cannot be reached.
    """
    chain, pose, rotation = pose_near_path(robot, near)
    place, found = points_m[0], []
    for point in points_m:
        steps = max(1, math.ceil(float(np.linalg.norm(point - place)) / STEP_M))
        for step in range(1, steps + 1):
            pose = reach(chain, place + (point - place) * step / steps, pose, rotation, "a point")
        place = point
        found.append(tuple(pose.tolist()))
    return tuple(found)


def reach(
    chain: Chain, point: FloatArray, near: FloatArray, rotation: FloatArray | None, what: str
) -> FloatArray:
    """Return joint positions with the tool point at a given point, starting the search at a pose.

    Args:
        chain: The arm.
        point: Shape (3,). Desired tool point in the base frame [m].
        near: Shape (n,). Joint positions at which the search starts, with the tool near the point.
        rotation: Shape (3, 3). Orientation that the last link's frame must keep; None leaves it
            free.
        what: Name of the point in a message.

    Raises:
        ConfigError: The point cannot be reached from there, or only through a singular pose.
    """
    pose = near
    place = ", ".join(f"{1e3 * x:.0f}" for x in point)
    for _ in range(ITERATIONS):
        short, slopes = (
            found[0] for found in _pose_error(chain, pose[np.newaxis], point[np.newaxis], rotation)
        )
        if np.abs(short).max() < TOLERANCE_M:
            return pose
        left, size, right = np.linalg.svd(slopes, full_matrices=False)
        if size[-1] < SINGULAR * size[0]:
            raise ConfigError(
                f"{what} ({place} mm) leads through a singular pose, in which the arm cannot move"
                " in every direction: shift or turn the path, or start the path near another pose",
                code="RID-PATH-SINGULAR",
            )
        step = right.T @ ((left.T @ short) / size)
        pose = pose + step * min(1.0, LONGEST_STEP / max(float(np.abs(step).max()), 1e-300))
    raise ConfigError(
        f"{what} ({place} mm) cannot be reached from {_describe_tool(chain, near)}: move the"
        " point nearer to the robot, or start the path near another pose",
        code="RID-PATH-REACH",
    )


def _describe_tool(chain: Chain, pose: FloatArray) -> str:
    """Return the position of the tool point in a pose, in words."""
    nowhere = np.zeros((1, 3))
    at = -_pose_error(chain, pose[np.newaxis], nowhere, None)[0][0]
    return f"the tool point ({', '.join(str(round(1e3 * x)) for x in at)} mm)"


class PathSlopes(NamedTuple):
    """Joint positions along a path of the tool point, with derivatives over the path length.

    Attributes:
        position, slope, bend: Shape (samples, n). Joint positions [rad or m], and their first and
            second derivatives with respect to the path length [rad/m and rad/m^2, or 1 and 1/m].
    """

    position: FloatArray
    slope: FloatArray
    bend: FloatArray


def refine_positions(
    chain: Chain,
    points_m: FloatArray,
    direction: FloatArray,
    curvature: FloatArray,
    near: FloatArray,
    rotation: FloatArray | None = None,
) -> PathSlopes:
    """Return joint positions along a path, and their derivatives, from good initial guesses.

    All points are solved at the same time.

    Args:
        chain: The arm.
        points_m, direction, curvature: Shape (samples, 3). The path in the base frame: points, unit
            tangents, and the derivative of the tangents by the length [1/m].
        near: Shape (samples, n). Initial guesses.
        rotation: Shape (3, 3). Orientation that the last link's frame must keep; None leaves it
            free.

    Raises:
        ConfigError: The search does not converge from the initial guesses: the path is too near a
            singular pose.
    """
    position = np.array(near, dtype=float)
    for _ in range(ITERATIONS):
        short, slopes = _pose_error(chain, position, points_m, rotation)
        if np.abs(short).max() < TOLERANCE_M:
            break
        position += _solve(slopes, short)
    else:
        raise ConfigError(
            "the path comes too near a singular pose, in which the arm cannot move in every"
            " direction: shift or turn the path",
            code="RID-PATH-SINGULAR",
        )
    spin = np.zeros((len(points_m), 0 if rotation is None else 3))
    slope = _solve(slopes, np.concatenate([direction, spin], axis=1))
    step = STEP / np.maximum(np.abs(slope).max(axis=1, keepdims=True), 1e-12)
    rows = slopes.shape[1]
    ahead, behind = (
        jacobian(chain, position + sign * step * slope)[:, :rows] for sign in (1.0, -1.0)
    )
    turning = ((ahead - behind) / (2.0 * step[:, :, np.newaxis])) @ slope[:, :, np.newaxis]
    bend = _solve(slopes, np.concatenate([curvature, spin], axis=1) - turning[:, :, 0])
    return PathSlopes(position, slope, bend)


def _solve(slopes: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return, for each row, the smallest joint changes that produce the desired pose changes."""
    return np.asarray((np.linalg.pinv(slopes) @ wanted[:, :, np.newaxis])[:, :, 0])


def _pose_error(
    chain: Chain, pose: FloatArray, points: FloatArray, rotation: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    """Return the errors of position and orientation, (samples, 3 or 6), and the Jacobians."""
    last = link_transforms(chain, pose)[:, -1]
    short = points - (last[:, :3, :3] @ chain.tool_m + last[:, :3, 3])
    slopes = jacobian(chain, pose)
    if rotation is None:
        return short, slopes[:, :3]
    turned = rotation @ last[:, :3, :3].transpose(0, 2, 1)
    vee = [
        turned[:, 2, 1] - turned[:, 1, 2],
        turned[:, 0, 2] - turned[:, 2, 0],
        turned[:, 1, 0] - turned[:, 0, 1],
    ]
    return np.concatenate([short, 0.5 * np.stack(vee, axis=1)], axis=1), slopes
