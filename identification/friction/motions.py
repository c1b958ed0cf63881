"""Motions for the separate measurement of friction, adapted to a robot and its surroundings."""

from __future__ import annotations

from typing import Final

import numpy as np

from acquisition.motion.kinds.constant_velocity import ConstantVelocityMotion, SpeedRuns
from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.kinds.reversed import ReversedMotion
from config.arrays import FloatArray
from config.errors import ConfigError
from config.robot.bodies import Workspace
from config.robot.robot import Joint, RobotDescription
from dynamics.geometry.clearances import Clearances

RANGE_SHARE: Final = 0.8
WIDEST_RAD: Final = 4.0
SLOWEST_SHARE: Final = 0.01
FASTEST_SHARE: Final = 0.8
ACCELERATION_FRACTION: Final = 0.5
AT_SPEED_S: Final = 0.5
PLACES: Final = 400
POSES: Final = 2000


def constant_velocity_motion(
    robot: RobotDescription,
    workspace: Workspace | None = None,
    *,
    speeds: int = 8,
    repeats: int = 1,
    seed: int = 0,
) -> ConstantVelocityMotion:
    """Return runs of every joint at speeds from 1 % to at most 80 % of its limit, if they fit.

    The other joints stay at zero, or in the middle of their limits if zero is too far from it. If
    this pose is not clear of obstacles, the first clear random pose is used. A joint runs over the
    clear range around the pose, within the middle 80 % of its limits; a revolute joint runs over 4
    rad at most.

    Args:
        workspace: The robot's surroundings.
        speeds: Number of speeds per joint, in a geometric series.
        repeats: Number of runs at each speed.
        seed: Seed of the random poses.

    Raises:
        ConfigError: No pose is clear of obstacles, or a joint has no room to run.
    """
    clearances = Clearances.of(robot, workspace)
    pose = _clear_pose(robot, clearances, seed)
    joints = []
    for j, joint in enumerate(robot.joints):
        low, high = _free_range(clearances, pose, j, joint)
        limit = joint.limits.velocity
        fastest = min(FASTEST_SHARE * limit, _fastest(high - low, joint))
        if fastest < 2.0 * SLOWEST_SHARE * limit:
            raise ConfigError(
                f"joint {joint.name!r} can move only from {low:.3g} to {high:.3g}, which is too"
                " little for a run at constant speed: remove obstacles from the workspace, or"
                " write the motion file by hand",
                code="RID-MOTION-STROKE",
            )
        even = np.geomspace(SLOWEST_SHARE * limit, fastest, speeds)
        joints.append(
            SpeedRuns(
                joint=joint.name,
                low=float(low),
                high=float(high),
                speeds=tuple(float(f"{speed:.3g}") for speed in even),
            )
        )
    return ConstantVelocityMotion(
        kind="constant_velocity",
        robot=robot.name,
        pose=tuple(float(q) for q in pose),
        joints=tuple(joints),
        acceleration_fraction=ACCELERATION_FRACTION,
        repeats=repeats,
    )


def reversed_motion(forward: FourierMotion) -> ReversedMotion:
    """Return a periodic motion, then the same motion backwards in time; each at least twice."""
    return ReversedMotion.from_attributes(forward, kind="reversed", periods=max(2, forward.periods))


def _fastest(stretch: float, joint: Joint) -> float:
    """Return the speed at which two ramps and half a second between them fill the range."""
    per_speed = 1.875 / (ACCELERATION_FRACTION * joint.limits.acceleration)
    return float(
        (np.sqrt(AT_SPEED_S**2 + 4.0 * per_speed * stretch) - AT_SPEED_S) / (2.0 * per_speed)
    )


def _clear_pose(robot: RobotDescription, clearances: Clearances, seed: int) -> FloatArray:
    limits = [joint.limits for joint in robot.joints]
    low = np.array([x.position_min for x in limits])
    high = np.array([x.position_max for x in limits])
    middle, half = 0.5 * (low + high), 0.5 * RANGE_SHARE * (high - low)
    first = np.where(np.abs(middle) < half, 0.0, middle)
    drawn = np.random.default_rng(seed).uniform(-1.0, 1.0, (POSES, len(low)))
    return clearances.clear_pose(first, middle + half * drawn, robot.name)


def _free_range(
    clearances: Clearances, pose: FloatArray, j: int, joint: Joint
) -> tuple[float, float]:
    """Return the lowest and highest clear position of a joint around the pose."""
    limits = joint.limits
    middle = 0.5 * (limits.position_min + limits.position_max)
    half = 0.5 * RANGE_SHARE * (limits.position_max - limits.position_min)
    low, high = middle - half, middle + half
    if joint.type == "revolute" and high - low > WIDEST_RAD:
        low = max(low, pose[j] - 0.5 * WIDEST_RAD)
        high = low + WIDEST_RAD if low + WIDEST_RAD < high else high
    places = np.linspace(low, high, PLACES)
    poses = np.tile(pose, (PLACES, 1))
    poses[:, j] = places
    blocked = np.flatnonzero([not clearances.is_clear(each[np.newaxis]) for each in poses])
    below, above = blocked[places[blocked] < pose[j]], blocked[places[blocked] > pose[j]]
    return (
        float(places[below[-1] + 1]) if len(below) else float(low),
        float(places[above[0] - 1]) if len(above) else float(high),
    )
