"""Joint positions that put the tool point where it is wanted, along a path, by Newton's method."""

from __future__ import annotations

from typing import Final

import numpy as np

from config.errors import ConfigError
from dynamics.kinematics import Chain, FloatArray, jacobian, link_transforms

ITERATIONS: Final = 50
TOLERANCE_M: Final = 1e-11
LONGEST_STEP: Final = 0.3
SINGULAR: Final = 1e-3


def follow(
    chain: Chain, points_m: FloatArray, near: FloatArray, rotation: FloatArray | None = None
) -> FloatArray:
    """Return joint positions along a path of the tool point, from one point to the next.

    Parameters
    ----------
    chain : Chain
        The arm.
    points_m : (samples, 3) array
        Wanted tool points in the base frame; neighbours are close.
    near : (n,) array
        A pose near the first: it chooses among the arm's ways to reach it.
    rotation : (3, 3) array, optional
        Orientation of the last link's frame to hold; free, if not given. An arm of three joints has
        none to choose.

    Returns
    -------
    (samples, n) array
        Joint positions [rad or m].

    Raises
    ------
    ConfigError
        A point cannot be reached from the one before, or only through a singular pose.
    """
    found = np.empty((len(points_m), chain.n))
    pose = np.array(near, dtype=float)
    for number, point in enumerate(points_m):
        pose = _reach(chain, point, pose, rotation, f"point {number + 1} of {len(points_m)}")
        found[number] = pose
    return found


def _reach(
    chain: Chain, point: FloatArray, pose: FloatArray, rotation: FloatArray | None, what: str
) -> FloatArray:
    place = ", ".join(f"{1e3 * x:.0f}" for x in point)
    for _ in range(ITERATIONS):
        last = link_transforms(chain, pose[np.newaxis])[0, -1]
        short = point - (last[:3, :3] @ chain.tool_m + last[:3, 3])
        slopes = jacobian(chain, pose[np.newaxis])[0]
        if rotation is None:
            slopes = slopes[:3]
        else:
            turned = rotation @ last[:3, :3].T
            vee = [turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0]]
            short = np.concatenate([short, 0.5 * np.array([*vee, turned[1, 0] - turned[0, 1]])])
        if np.abs(short).max() < TOLERANCE_M:
            return pose
        left, size, right = np.linalg.svd(slopes, full_matrices=False)
        if size[-1] < SINGULAR * size[0]:
            raise ConfigError(
                f"{what} of the path ({place} mm) leads through a pose in which the arm cannot move"
                " in every direction: shift or turn the path, or start it near another pose"
            )
        step = right.T @ ((left.T @ short) / size)
        pose = pose + step * min(1.0, LONGEST_STEP / max(float(np.abs(step).max()), 1e-300))
    raise ConfigError(
        f"{what} of the path ({place} mm) cannot be reached: move it nearer to the robot, or start"
        " it near another pose"
    )
