"""The multi-point motion: smooth moves through random poses, to validate a model with."""

from __future__ import annotations

import itertools
import math

import numpy as np

from acquisition.motion.ramps import Path, join, rest_to_rest, rest_to_rest_duration, standstill
from config.arrays import FloatArray
from config.motion.motion import MultipointMotion
from config.robot.robot import RobotDescription


def random_poses(motion: MultipointMotion, robot: RobotDescription) -> FloatArray:
    """Return the poses that the motion goes through, the same ones for the same seed.

    Each joint is drawn evenly from the middle `range_fraction` of its limits.

    Returns
    -------
    ndarray, shape (points, joints)
        Poses [rad or m].
    """
    low = np.array([joint.limits.position_min for joint in robot.joints])
    high = np.array([joint.limits.position_max for joint in robot.joints])
    middle, half = (low + high) / 2.0, (high - low) / 2.0 * motion.range_fraction
    draws = np.random.default_rng(motion.seed).uniform(-1.0, 1.0, (motion.points, len(low)))
    return np.asarray(middle + half * draws, dtype=np.float64)


def multipoint_path(
    motion: MultipointMotion, robot: RobotDescription, sample_period_s: float
) -> Path:
    """Return the samples of quintic moves from pose to pose, with a dwell at each.

    A move takes the time that its slowest joint needs at `speed_fraction` of its limits, rounded
    up to whole samples.
    """
    poses = random_poses(motion, robot)
    dwell = max(1, math.ceil(motion.dwell_s / sample_period_s))
    pieces = [standstill(poses[0], dwell)]
    moves_s = multipoint_moves_s(motion, robot)
    for (start, end), duration_s in zip(itertools.pairwise(poses), moves_s, strict=True):
        samples = max(1, math.ceil(duration_s / sample_period_s))
        pieces.append(rest_to_rest(start, end, samples, sample_period_s))
        pieces.append(standstill(end, dwell))
    return join(pieces)


def multipoint_moves_s(motion: MultipointMotion, robot: RobotDescription) -> list[float]:
    """Return how long each of the moves takes [s]."""
    velocity_limit = motion.speed_fraction * np.array([j.limits.velocity for j in robot.joints])
    acceleration_limit = motion.speed_fraction * np.array(
        [joint.limits.acceleration for joint in robot.joints]
    )
    return [
        rest_to_rest_duration(end - start, velocity_limit, acceleration_limit)
        for start, end in itertools.pairwise(random_poses(motion, robot))
    ]
