"""Paths in joint positions: curves through poses, and tables of positions over time."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline, make_interp_spline

from acquisition.motion.cartesian_path import ATTEMPTS, SLOWER, joint_rows
from acquisition.motion.limits import violations
from acquisition.motion.path_speed import progress, speed_limits
from acquisition.motion.ramps import Path, join, standstill
from config.arrays import FloatArray
from config.errors import ConfigError, LimitError
from config.motion.path_motion import JointPathMotion, JointTableMotion
from config.robot.robot import RobotDescription
from dynamics.geometry.inverse_kinematics import PathSlopes

POINTS_A_CHORD: Final = 40
FEWEST: Final = 200
AT_REST: Final = 0.02
FEWEST_ROWS: Final = 6


def joint_path_motion(
    motion: JointPathMotion, robot: RobotDescription, sample_period_s: float
) -> Path:
    """Return the motion along a smooth curve through poses, from rest to rest.

    Raises
    ------
    ConfigError
        A pose, or the curve between two, is outside the limits; the text names it.
    """
    points = _poses(motion, robot)
    speeds = np.array([joint.limits.velocity for joint in robot.joints])
    chords = (np.abs(np.diff(points, axis=0)) / speeds).max(axis=1)
    if chords.min() <= 0.0:
        number = int(chords.argmin()) + 2
        raise ConfigError(
            f"point {number} of the path is the same as the one before: leave one out"
        )
    knots = np.concatenate([[0.0], np.cumsum(chords)])
    curve = CubicSpline(knots, points) if len(points) > 2 else _straight(knots, points)
    count = max(FEWEST, POINTS_A_CHORD * len(chords))
    grid = np.unique(np.concatenate([np.linspace(0.0, knots[-1], count + 1), knots]))
    _refuse_between(curve(grid), grid, knots, robot)
    slope, bend = curve(grid, 1), curve(grid, 2)
    limits = speed_limits(
        grid,
        np.full(len(grid), math.inf),
        slope,
        bend,
        robot,
        motion.jerk_time_s,
        fraction=motion.speed_fraction,
    )
    attempts = 0
    while True:
        rows = progress(limits, sample_period_s)
        at = PathSlopes(*(curve(rows.length, order) for order in range(3)))
        path = joint_rows(at, rows)
        attempts += 1
        if attempts == ATTEMPTS or not violations(path, robot, sample_period_s, 2):
            return _with_rests(path, motion.dwell_s, sample_period_s)
        limits = limits.slower(SLOWER)


def joint_table_motion(
    motion: JointTableMotion, robot: RobotDescription, sample_period_s: float
) -> Path:
    """Return the smooth motion through a table's rows, sampled at the cycle time.

    Raises
    ------
    ConfigError
        The table is of other joints, its times do not increase, it does not begin and end at rest,
        or a row is outside the limits; the text names the row.
    """
    if sorted(motion.joints) != sorted(robot.joint_names):
        raise ConfigError(
            f"the table has columns {', '.join(motion.joints) or 'of no joint'}; robot"
            f" {robot.name!r} needs each of {', '.join(robot.joint_names)} once"
        )
    order = [motion.joints.index(name) for name in robot.joint_names]
    time_s, position = np.array(motion.time_s), np.array(motion.position)[:, order]
    if len(time_s) < FEWEST_ROWS:
        raise ConfigError(f"the table has {len(time_s)} rows, {FEWEST_ROWS} are the least")
    steps = np.diff(time_s)
    if (steps <= 0.0).any():
        row = int(np.argmax(steps <= 0.0)) + 2
        raise ConfigError(
            f"row {row} of the table is at {time_s[row - 1]:g} s, not after the one before: time_s"
            " must increase"
        )
    for j, joint in enumerate(robot.joints):
        low, high = joint.limits.position_min, joint.limits.position_max
        off = (position[:, j] < low) | (position[:, j] > high)
        if off.any():
            row = int(np.argmax(off))
            raise LimitError(
                f"row {row + 1} of the table has joint {joint.name!r} at {position[row, j]:.4g},"
                f" outside its limits {low:g} to {high:g}"
            )
        for row, speed in (
            (1, abs(position[1, j] - position[0, j]) / steps[0]),
            (len(time_s), abs(position[-1, j] - position[-2, j]) / steps[-1]),
        ):
            if speed > AT_REST * joint.limits.velocity:
                raise ConfigError(
                    f"at row {row} of the table joint {joint.name!r} moves at {speed:.3g} per"
                    " second: the table must begin and end at rest. Add rows that lead into and out"
                    " of the motion"
                )
    rest = [(1, np.zeros(len(robot.joints))), (2, np.zeros(len(robot.joints)))]
    curve = make_interp_spline(time_s, position, k=5, bc_type=(rest, rest))  # type: ignore[arg-type]
    rows = math.ceil((time_s[-1] - time_s[0]) / sample_period_s - 1e-9)
    at_s = np.minimum(time_s[0] + np.arange(rows + 1) * sample_period_s, time_s[-1])
    path = Path(*(np.asarray(curve(at_s, order)) for order in range(3)))
    return _with_rests(path, motion.dwell_s, sample_period_s)


def _poses(motion: JointPathMotion, robot: RobotDescription) -> FloatArray:
    for number, point in enumerate(motion.points, start=1):
        if len(point) != len(robot.joints):
            raise ConfigError(
                f"point {number} of the path has {len(point)} values, robot {robot.name!r}"
                f" {len(robot.joints)} joints"
            )
        for joint, value in zip(robot.joints, point, strict=True):
            low, high = joint.limits.position_min, joint.limits.position_max
            if not low <= value <= high:
                raise LimitError(
                    f"point {number} of the path has joint {joint.name!r} at {value:.4g}, outside"
                    f" its limits {low:g} to {high:g}"
                )
    return np.array(motion.points, dtype=float)


def _straight(knots: FloatArray, points: FloatArray) -> CubicSpline:
    """Return the straight way between two poses."""
    slope = (points[1] - points[0]) / (knots[1] - knots[0])
    return CubicSpline(knots, points, bc_type=((1, slope), (1, slope)))


def _refuse_between(
    position: FloatArray, grid: FloatArray, knots: FloatArray, robot: RobotDescription
) -> None:
    for j, joint in enumerate(robot.joints):
        low, high = joint.limits.position_min, joint.limits.position_max
        off = np.maximum(low - position[:, j], position[:, j] - high)
        if off.max() > 0.0:
            number = int(np.searchsorted(knots, grid[off.argmax()]))
            raise LimitError(
                f"the curve between points {number} and {number + 1} of the path has joint"
                f" {joint.name!r} at {position[off.argmax(), j]:.4g}, outside its limits {low:g} to"
                f" {high:g}: move the points"
            )


def _with_rests(path: Path, dwell_s: float, sample_period_s: float) -> Path:
    rest = max(1, math.ceil(dwell_s / sample_period_s))
    before, after = standstill(path.position[0], rest), standstill(path.position[-1], rest)
    return join([before, path, after])
