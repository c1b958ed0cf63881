"""Paths of the tool point as joint motion: the arm follows them within every limit."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline

from acquisition.motion.limits import refuse, violations
from acquisition.motion.path_geometry import Along, Stretch, stretches
from acquisition.motion.path_speed import (
    Progress,
    SpeedLimits,
    bend_speed,
    joint_speed,
    progress,
    speed_limits,
)
from acquisition.motion.ramps import Path, join, standstill
from config.arrays import FloatArray
from config.errors import ConfigError
from config.motion.path_motion import PathMotion
from config.robot.robot import RobotDescription
from dynamics.geometry.inverse_kinematics import PathSlopes, reach, refine
from dynamics.geometry.kinematics import Chain, link_transforms

COARSE_M: Final = 0.005
FINE_M: Final = 0.001
FEWEST: Final = 200
MOST: Final = 20_000
SLOWEST_SHARE: Final = 0.02
SLOWER: Final = 0.95
ATTEMPTS: Final = 30


def path_motion(motion: PathMotion, robot: RobotDescription, sample_period_s: float) -> Path:
    """Return the joint motion that leads the tool point along a path, from rest to rest.

    Raises
    ------
    ConfigError
        A part of the path cannot be reached, comes too near a singular pose, is beyond a joint's
        limit, or cannot keep its speed where it must; the text names the segment.
    """
    chain, pose, rotation = _arm(motion, robot)
    rest = max(1, math.ceil(motion.dwell_s / sample_period_s))
    pieces: list[Path] = []
    for stretch in stretches(motion):
        way, pose = _way(stretch, chain, pose, rotation)
        grid = np.linspace(0.0, stretch.length_m, _points(stretch, FINE_M))
        along = stretch.at(grid)
        joints = _joints(chain, along, way(grid), rotation)
        _refuse_positions(stretch, grid, joints.position, robot)
        limits = _limits(motion, stretch, grid, along, joints, robot)
        moving = _driven(stretch, limits, chain, way, rotation, robot, sample_period_s)
        pieces += [standstill(joints.position[0], rest), moving]
    last = pieces[-1].position[-1]
    return join([*pieces, standstill(last, rest)])


def segment_at(
    motion: PathMotion, robot: RobotDescription, sample_period_s: float, row: int
) -> str:
    """Say where on a path a row of its motion is."""
    rest = max(1, math.ceil(motion.dwell_s / sample_period_s))
    chain, pose, rotation = _arm(motion, robot)
    for stretch in stretches(motion):
        way, pose = _way(stretch, chain, pose, rotation)
        grid = np.linspace(0.0, stretch.length_m, _points(stretch, FINE_M))
        along = stretch.at(grid)
        joints = _joints(chain, along, way(grid), rotation)
        limits = _limits(motion, stretch, grid, along, joints, robot)
        rows = _progressed(stretch, limits, chain, way, rotation, robot, sample_period_s)[0]
        if row < rest + len(rows.length):
            return stretch.where(float(rows.length[max(0, row - rest)]))
        row -= rest + len(rows.length)
    return "the end of the path"


def _arm(
    motion: PathMotion, robot: RobotDescription
) -> tuple[Chain, FloatArray, FloatArray | None]:
    """Return the chain, the pose to begin near, and the orientation to keep, if any."""
    n = len(robot.joints)
    if len(motion.near) != n:
        raise ConfigError(f"near has {len(motion.near)} values, robot {robot.name!r} {n} joints")
    chain = Chain.from_description(robot)
    near = np.array(motion.near, dtype=float)
    rotation = None if n == 3 else link_transforms(chain, near[np.newaxis])[0, -1][:3, :3]
    start = reach(chain, np.array(motion.start_m), near, rotation, "the start of the path")
    return chain, start, rotation


def _points(stretch: Stretch, spacing_m: float) -> int:
    return 1 + int(np.clip(math.ceil(stretch.length_m / spacing_m), FEWEST, MOST))


def _way(
    stretch: Stretch, chain: Chain, pose: FloatArray, rotation: FloatArray | None
) -> tuple[CubicSpline, FloatArray]:
    """Follow a stretch in coarse steps; return poses near it by length, and the last one."""
    lengths = np.linspace(0.0, stretch.length_m, _points(stretch, COARSE_M))
    found = np.empty((len(lengths), chain.n))
    points = stretch.at(lengths).point_m
    for k, (length_m, point) in enumerate(zip(lengths.tolist(), points, strict=True)):
        pose = reach(chain, point, pose, rotation, f"{stretch.where(length_m)},")
        found[k] = pose
    return CubicSpline(lengths, found), pose


def _joints(
    chain: Chain, along: Along, near: FloatArray, rotation: FloatArray | None
) -> PathSlopes:
    return refine(chain, along.point_m, along.direction, along.curvature, near, rotation)


def _refuse_positions(
    stretch: Stretch, grid: FloatArray, position: FloatArray, robot: RobotDescription
) -> None:
    for j, joint in enumerate(robot.joints):
        low, high = joint.limits.position_min, joint.limits.position_max
        off = np.maximum(low - position[:, j], position[:, j] - high)
        if off.max() > 0.0:
            row = int(np.argmax(off > 0.0))
            raise ConfigError(
                f"{stretch.where(float(grid[row]))}, needs joint {joint.name!r} beyond its limits"
                f" {low:g} to {high:g}: it would reach {position[off.argmax(), j]:.4g}. Move the"
                " path, or start it near another pose"
            )


def _limits(
    motion: PathMotion,
    stretch: Stretch,
    grid: FloatArray,
    along: Along,
    joints: PathSlopes,
    robot: RobotDescription,
) -> SpeedLimits:
    """Return the speed limits of a stretch; refuse those that cannot be meant."""
    number = stretch.piece_at(grid)
    asked = np.array([piece.speed_m_s for piece in stretch.pieces])[number]
    for j, joint in enumerate(robot.joints):
        share = joint_speed(joints.slope, robot)[:, j] / asked
        worst = int(share.argmin())
        if share[worst] < SLOWEST_SHARE:
            raise ConfigError(
                f"{stretch.where(float(grid[worst]))}, comes too near a singular pose: there joint"
                f" {joint.name!r} lets it go at {1e3 * share[worst] * asked[worst]:.2g} mm/s only."
                " Move the path, or start it near another pose"
            )
    bend = np.linalg.norm(along.curvature, axis=1)
    inside = number[1:] == number[:-1]
    change = np.linalg.norm(np.diff(along.curvature, axis=0), axis=1) / np.diff(grid) * inside
    change = np.maximum(np.append(change, 0.0), np.append(0.0, change))
    speed = np.minimum(asked, np.sqrt(motion.acceleration_m_s2 / np.maximum(bend, 1e-12)))
    speed = np.minimum(speed, np.cbrt(motion.jerk_m_s3 / np.maximum(change, 1e-12)))
    limits = speed_limits(
        grid,
        speed,
        joints.slope,
        joints.bend,
        robot,
        2.0 * motion.acceleration_m_s2 / motion.jerk_m_s3,
        acceleration=motion.acceleration_m_s2,
    )
    if motion.keep_speed and (limits.speed < asked * (1.0 - 1e-9)).any():
        _refuse_slowing(stretch, grid, asked, speed, limits, joints, robot)
    return limits


def _refuse_slowing(
    stretch: Stretch,
    grid: FloatArray,
    asked: FloatArray,
    speed: FloatArray,
    limits: SpeedLimits,
    joints: PathSlopes,
    robot: RobotDescription,
) -> None:
    worst = int((limits.speed / asked).argmin())
    by = "acceleration_m_s2 or jerk_m_s3 in the bend"
    if limits.speed[worst] < speed[worst]:
        own = {
            "velocity": joint_speed(joints.slope, robot)[worst],
            "acceleration": bend_speed(joints.bend, robot)[worst],
        }
        what = min(own, key=lambda name: float(own[name].min()))
        by = f"the {what} limit of joint {robot.joints[int(own[what].argmin())].name!r}"
    raise ConfigError(
        f"{stretch.where(float(grid[worst]))}, cannot keep {asked[worst]:g} m/s: {by} allows"
        f" {limits.speed[worst]:.3g} m/s. Ask for less, widen the bend, or leave keep_speed out"
    )


def _driven(
    stretch: Stretch,
    limits: SpeedLimits,
    chain: Chain,
    way: CubicSpline,
    rotation: FloatArray | None,
    robot: RobotDescription,
    sample_period_s: float,
) -> Path:
    rows, path = _progressed(stretch, limits, chain, way, rotation, robot, sample_period_s)
    broken = violations(path, robot, sample_period_s)
    if broken:
        refuse(broken, f"the path, {stretch.where(float(rows.length[len(rows.length) // 2]))},")
    return path


def _progressed(
    stretch: Stretch,
    limits: SpeedLimits,
    chain: Chain,
    way: CubicSpline,
    rotation: FloatArray | None,
    robot: RobotDescription,
    sample_period_s: float,
) -> tuple[Progress, Path]:
    """Return the way along a stretch, slowed down until the joints' limits hold between rows."""
    attempts = 0
    while True:
        rows = progress(limits, sample_period_s)
        joints = _joints(chain, stretch.at(rows.length), way(rows.length), rotation)
        path = joint_rows(joints, rows)
        attempts += 1
        if attempts == ATTEMPTS or not violations(path, robot, sample_period_s, 2):
            return rows, path
        limits = limits.slower(SLOWER)


def joint_rows(joints: PathSlopes, rows: Progress) -> Path:
    """Return joint positions, velocities and accelerations of a path driven at some speed."""
    speed = rows.speed[:, np.newaxis]
    return Path(
        joints.position,
        joints.slope * speed,
        joints.bend * speed**2 + joints.slope * rows.acceleration[:, np.newaxis],
    )
