"""Smooth curve through joint poses, as fast as the limits permit."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from acquisition.motion.kinds.motion import Motion, Poses, Position, Seconds
from acquisition.motion.kinds.pose_sequence import reachable_poses
from acquisition.motion.paths.joint_spline import joint_spline
from acquisition.motion.paths.speed import plan_speed, speed_limits
from acquisition.motion.samples import MotionSamples, with_rests
from config.arrays import FloatArray
from config.errors import ConfigError, LimitError
from config.robot.robot import RobotDescription
from dynamics.geometry.inverse_kinematics import PathSlopes

POINTS_A_CHORD: Final = 40
FEWEST: Final = 200
NEAR: Final = 1e-3
"""Fraction of the median distance between neighbouring poses; two poses that are closer are named
as the cause if the curve exceeds a limit."""
SAME_POSE: Final = 1e-6
"""Largest difference between poses that count as the same [rad or m]."""


class JointPathMotion(Motion):
    """Smooth curve (of class C2) through poses, from rest to rest, as fast as the limits permit.

    Consecutive poses that differ by at most 1e-6 rad or m in each joint count as one pose.

    Attributes:
        points: Poses on the curve, each with one position per joint, base to flange [rad or m].
        speed_fraction: Fraction of the joints' velocity and acceleration limits that is used.
        jerk_time_s: Shortest time in which the acceleration changes from one limit to the other
            [s].
        dwell_s: Rest before and after the motion [s].
    """

    kind: Literal["joint_path"]
    points: tuple[tuple[Position, ...], ...] = Field(min_length=2, max_length=10_000)
    speed_fraction: Annotated[float, Field(gt=0.0, le=1.0)] = 0.5
    jerk_time_s: Seconds = 0.1
    dwell_s: Annotated[float, Field(ge=0.0, le=60.0)] = 0.2

    def describe(self) -> str:
        """Return a description of the motion in one sentence."""
        return f"A curve through {len(self.points)} poses."

    def next_command(self, run: Path) -> tuple[object, ...]:
        """Return the command that evaluates the path error of a run."""
        return "tracking", run

    def chosen_poses(self, robot: RobotDescription, most: int) -> Poses | None:
        """Return the poses of the file; None if there are more than `most`."""
        return None if len(self.points) > most else self.points

    def _samples(self, robot: RobotDescription, sample_period_s: float) -> MotionSamples:
        poses = reachable_poses(self.points, robot)
        numbers = _different_poses(poses)
        if len(numbers) < 2:
            raise ConfigError(
                f"all {len(poses)} points of the path are the same pose: give at least two"
                " different poses",
                code="RID-PATH-SEGMENT",
            )
        points = poses[numbers]
        speeds = np.array([joint.limits.velocity for joint in robot.joints])
        chords = (np.abs(np.diff(points, axis=0)) / speeds).max(axis=1)
        knots = np.concatenate([[0.0], np.cumsum(chords)])
        curve = joint_spline(knots, points)
        count = max(FEWEST, POINTS_A_CHORD * len(chords))
        grid = np.unique(np.concatenate([np.linspace(0.0, knots[-1], count + 1), knots]))
        _check_curve_limits(curve(grid), grid, knots, numbers, robot)
        limits = speed_limits(
            grid,
            np.full(len(grid), math.inf),
            curve(grid, 1),
            curve(grid, 2),
            robot,
            self.jerk_time_s,
            fraction=self.speed_fraction,
        )

        def joints_at(length: FloatArray) -> PathSlopes:
            return PathSlopes(*(curve(length, order) for order in range(3)))

        _, path = plan_speed(limits, joints_at, robot, sample_period_s)
        return with_rests(path, self.dwell_s, robot.joint_names, sample_period_s)


def _different_poses(poses: FloatArray) -> list[int]:
    """Return the indices of poses that differ from the previous one, with the first and last."""
    kept = [0]
    for row in range(1, len(poses)):
        if np.abs(poses[row] - poses[kept[-1]]).max() > SAME_POSE:
            kept.append(row)
    return kept if len(kept) == 1 else [*kept[:-1], len(poses) - 1]


def _check_curve_limits(
    position: FloatArray,
    grid: FloatArray,
    knots: FloatArray,
    numbers: list[int],
    robot: RobotDescription,
) -> None:
    for j, joint in enumerate(robot.joints):
        low, high = joint.limits.position_min, joint.limits.position_max
        off = np.maximum(low - position[:, j], position[:, j] - high)
        if off.max() > 0.0:
            after = int(np.searchsorted(knots, grid[off.argmax()]))
            chords = np.diff(knots)
            nearest = int(chords.argmin())
            remedy = "move the points"
            if chords[nearest] < NEAR * np.median(chords[chords > NEAR * chords.max()]):
                first, second = numbers[nearest] + 1, numbers[nearest + 1] + 1
                remedy = f"points {first} and {second} are almost the same: leave one of them out"
            raise LimitError(
                f"between points {numbers[after - 1] + 1} and {numbers[after] + 1} of the path,"
                f" joint {joint.name!r} would reach {position[off.argmax(), j]:.4g} {joint.unit},"
                f" outside its limits {low:g} to {high:g} {joint.unit}: {remedy}",
                code="RID-MOTION-LIMIT",
            )
