"""`approach`: slow move from the robot's present pose to the start of a motion."""

from __future__ import annotations

import math

from acquisition.motion.limits import verify_limits
from acquisition.motion.ramps import move_duration, rest_to_rest
from acquisition.motion.samples import MotionSamples, Phase, join, phases_of, standstill
from config.arrays import FloatArray, read_only
from config.errors import ConfigError
from config.robot.robot import RobotDescription

APPROACH_SPEED_FRACTION = 0.3


def approach(
    from_position: FloatArray,
    to_position: FloatArray,
    robot: RobotDescription,
    sample_period_s: float,
) -> MotionSamples:
    """Return a move from rest to rest within 30 % of the velocity and acceleration limits.

    Args:
        from_position, to_position: Shape (joints,). Present pose of the robot, and start of the
            motion [rad or m].
        robot: Joints and limits.
        sample_period_s: Cycle time of the cell [s].

    Raises:
        ConfigError: A pose is outside the position limits.
    """
    n = len(robot.joints)
    start = read_only("pose to start from", from_position, float, (n,), ConfigError)
    end = read_only("pose to go to", to_position, float, (n,), ConfigError)
    duration_s = move_duration(end - start, robot, APPROACH_SPEED_FRACTION)
    rows = max(1, math.ceil(duration_s / sample_period_s))
    path = join([rest_to_rest(start, end, rows, sample_period_s), standstill(end, 1)])
    samples = MotionSamples(
        robot.joint_names, sample_period_s, *path, phase=phases_of((Phase.APPROACH, rows + 1))
    )
    verify_limits(samples, robot)
    return samples
