"""A multisine motion for a robot, as large as its limits comfortably allow."""

from __future__ import annotations

from typing import Final

import numpy as np

from acquisition.motion_samples import plan_motion
from config.errors import ConfigError
from config.motion import MultisineJoint, MultisineMotion
from config.robot import RobotDescription

SHARE_OF_ACCELERATION: Final = 0.05
SHARE_OF_RANGE: Final = 0.04
SHARE_OF_SPEED: Final = 0.2
SMALLER: Final = 0.8
ATTEMPTS: Final = 12


def multisine_motion(
    robot: RobotDescription,
    sample_period_s: float,
    *,
    period_s: float = 8.0,
    lowest_hz: float = 0.5,
    highest_hz: float = 15.0,
    seed: int = 0,
) -> MultisineMotion:
    """Return a multisine about the middle of every joint's range, verified within the limits.

    The speeds are small, so that the torque stays far from its limit, on top of a slow sine that
    keeps friction from sticking most of the time. Amplitudes shrink until every limit holds.

    Raises
    ------
    ConfigError
        Not even a small one holds the limits, or period and band do not suit the cell.
    """
    fastest = 2.0 * np.pi * highest_hz
    speeds = [SHARE_OF_ACCELERATION * joint.limits.acceleration for joint in robot.joints]
    slow = [
        min(
            SHARE_OF_RANGE * (joint.limits.position_max - joint.limits.position_min),
            SHARE_OF_SPEED * joint.limits.velocity * period_s / (2.0 * np.pi),
        )
        for joint in robot.joints
    ]
    share, reason = 1.0, ConfigError("")
    for _ in range(ATTEMPTS):
        motion = MultisineMotion(
            kind="multisine",
            robot=robot.name,
            period_s=period_s,
            lowest_hz=lowest_hz,
            highest_hz=highest_hz,
            seed=seed,
            joints=tuple(
                MultisineJoint(
                    joint=joint.name,
                    offset=0.5 * (joint.limits.position_min + joint.limits.position_max),
                    velocity=round(share * speed * 10.0 / fastest, 6),
                    slow_amplitude=round(share * amplitude, 6),
                )
                for joint, speed, amplitude in zip(robot.joints, speeds, slow, strict=True)
            ),
        )
        try:
            plan_motion(motion, robot, sample_period_s)
        except ConfigError as error:
            share, reason = share * SMALLER, error
            continue
        return motion
    raise reason
