"""`HoldLine`: a straight line in joint space, checked for limits and collisions, with its pace."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.motion.collision import rows_before_collision
from config.arrays import FloatArray
from config.cell.cell import CellConfig
from config.errors import ConfigError
from config.ranges import CODE, JogPercent, upper_bound
from config.robot.robot import RobotDescription
from dynamics.geometry.clearances import Clearances
from dynamics.geometry.kinematics import Chain, forward

REDUCED_SPEED_M_S: Final = 0.25
"""Largest speed of the tool point with people near the robot (ISO 10218-1, reduced speed)."""

FASTEST_SHARE: Final = upper_bound(JogPercent) / 100.0
LIMIT_MARGIN: Final = 0.01
STEP: Final = 0.01
TOLERANCE_M: Final = 1e-6
"""Distance by which bodies that are too close at the start may come closer [m]; it is small because
these distances add up over many presses."""


@dataclass(frozen=True, eq=False)
class HoldLine:
    """A straight line in joint space, checked for limits and collisions.

    Attributes:
        start, goal: Shape (joints,). Start and end of the line [rad or m].
        pace_per_s: Fraction of the line that may be driven per second [1/s].
        obstacle: Name of the obstacle or limit before which the line was cut; empty if the line is
            complete.
    """

    start: FloatArray
    goal: FloatArray
    pace_per_s: float
    obstacle: str = ""

    @property
    def is_empty(self) -> bool:
        """True if the start and the goal of the line are equal."""
        return bool((self.start == self.goal).all())


class LineCheck:
    """Check of straight lines in joint space for limits and collisions.

    Args:
        cell, robot: Limits, bodies and surroundings.
        speed_share: Largest fraction of each joint's velocity limit at which a line is driven, at
            most `FASTEST_SHARE`. The tool's speed is also limited, to `REDUCED_SPEED_M_S`.

    Raises:
        ConfigError: `speed_share` is not above 0, is larger than permitted, or is not a number.
    """

    def __init__(self, cell: CellConfig, robot: RobotDescription, speed_share: float) -> None:
        if not 0.0 < speed_share <= FASTEST_SHARE:
            raise ConfigError(
                f"invalid speed {speed_share:g} of a motion by hand, as a fraction of the joint"
                f" speed limits: give more than 0 and at most {FASTEST_SHARE:g}",
                code=CODE,
            )
        self._robot = robot
        self._clearances = Clearances.of(robot, cell.workspace)
        self._chain = Chain.from_description(robot)
        self._speed = speed_share * np.array([each.limits.velocity for each in robot.joints])
        low = np.array([each.limits.position_min for each in robot.joints])
        high = np.array([each.limits.position_max for each in robot.joints])
        margin = np.minimum(LIMIT_MARGIN, 0.05 * (high - low))
        self._low, self._high = low + margin, high - margin

    def __call__(self, start: FloatArray, wanted: FloatArray) -> HoldLine:
        """Return the collision-free part of the line from one pose to another, (joints,) each.

        The line ends before a joint's limit, or before two bodies come too close. If two bodies are
        already too close at the start, the line may increase their distance.
        """
        share, obstacle = self._within_limits(start, wanted)
        goal = start + share * (wanted - start)
        rows = 1 + max(1, math.ceil(np.abs(goal - start).max() / STEP))
        poses = start + np.linspace(0.0, 1.0, rows)[:, np.newaxis] * (goal - start)
        clear = rows_before_collision(self._clearances, poses, tolerance_m=TOLERANCE_M)
        if clear < rows:
            near = self._clearances.nearest(poses[clear : clear + 1])
            obstacle = self._clearances.names[int(np.argmin(near))]
            poses = poses[: max(1, clear)]
        return HoldLine(start, poses[-1], self._pace(poses), obstacle)

    def _within_limits(self, start: FloatArray, wanted: FloatArray) -> tuple[float, str]:
        """Return the fraction of a line that is within the limits, and the limit that cuts it."""
        share, obstacle = 1.0, ""
        for i, joint in enumerate(self._robot.joints):
            way = wanted[i] - start[i]
            if way == 0.0:
                continue
            room = (self._high[i] if way > 0.0 else self._low[i]) - start[i]
            if room / way < share:
                share, obstacle = max(0.0, float(room / way)), f"the limit of {joint.name}"
        return share, obstacle

    def _pace(self, poses: FloatArray) -> float:
        """Return the largest fraction of a line per second within all speed limits [1/s]."""
        way = np.abs(poses[-1] - poses[0])
        if not way.any():
            return 1.0
        moving = way > 0.0
        pace = float((self._speed[moving] / way[moving]).min())
        steps = np.linalg.norm(np.diff(forward(self._chain, poses), axis=0), axis=1)
        fastest = float(steps.max()) * len(steps)  # [m/s] at a pace of 1/s
        return pace if fastest == 0.0 else min(pace, REDUCED_SPEED_M_S / fastest)
