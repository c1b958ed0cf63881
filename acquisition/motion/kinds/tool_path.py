"""Tool-point paths as joint motions within all limits."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

import numpy as np
from pydantic import Field

from acquisition.motion.kinds.motion import Motion, Poses, Position, ToolSpeed, refuse_longer
from acquisition.motion.limits import refuse, violations
from acquisition.motion.paths.sections import PathPoints, PathSection, path_sections
from acquisition.motion.paths.segments import Blend, LineSegment, Segment
from acquisition.motion.paths.speed import (
    SpeedLimits,
    bend_speed,
    joint_speed,
    plan_speed,
    speed_limits,
)
from acquisition.motion.samples import (
    JointTrajectory,
    MotionSamples,
    Phase,
    join,
    phases_of,
    standstill,
)
from config.arrays import FloatArray
from config.errors import ConfigError
from config.plausible import Plausible
from config.quantities import Place, Positive
from config.robot.robot import RobotDescription
from dynamics.geometry.inverse_kinematics import (
    PathSlopes,
    pose_near_path,
    poses_on_lines,
    reach,
    refine_positions,
)
from dynamics.geometry.kinematics import Chain

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

COARSE_M: Final = 0.005
FINE_M: Final = 0.001
FEWEST: Final = 200
MOST: Final = 20_000
SLOWEST_SHARE: Final = 0.02


class PathMotion(Motion):
    """Tool-point motion along lines, arcs, circles and splines, from rest to rest.

    The path is slower than `speed_m_s` if its accelerations or a joint's limits require it.

    Attributes:
        start_m: Start point in the base frame [m].
        near: Pose close to the start, one position per joint, base to flange [rad or m]. It selects
            the arm configuration and, if there are more than three joints, the constant orientation
            of the flange.
        speed_m_s: Speed of the tool point along the path [m/s].
        acceleration_m_s2: Largest acceleration of the tool point, along the path and across it
            [m/s²].
        jerk_m_s3: Largest jerk of the tool point, along the path and across it [m/s³].
        blend_m: Distance before the end of each segment at which the blend to the next one begins
            [m]. With 0 the tool point stops in the corner.
        keep_speed: True to refuse a path that must be slower than `speed_m_s`.
        dwell_s: Rest at the start, at the end, and in corners without a blend [s].
        segments: Segments of the path, in their order.
    """

    kind: Literal["path"]
    start_m: Place
    near: tuple[Position, ...] = Field(min_length=1)
    speed_m_s: ToolSpeed
    acceleration_m_s2: Annotated[Positive, Plausible(1e-3, 500.0, "m/s²")] = 4.0
    jerk_m_s3: Annotated[Positive, Plausible(1e-2, 1e6, "m/s³")] = 80.0
    blend_m: Blend = 0.0
    keep_speed: bool = False
    dwell_s: Annotated[float, Field(ge=0.0, le=60.0)] = 0.2
    segments: tuple[Segment, ...] = Field(min_length=1, max_length=10_000)

    def describe(self) -> str:
        """Return a description of the motion in one sentence."""
        return f"A path of {len(self.segments)} segments at up to {self.speed_m_s:g} m/s."

    def next_command(self, run: Path) -> tuple[object, ...]:
        """Return the command that evaluates the path error of a run."""
        return "tracking", run

    def chosen_poses(self, robot: RobotDescription, most: int) -> Poses | None:
        """Return the poses at the ends of the lines.

        None if a segment is not a line, or has its own speed or blend, if there are more than
        `most` poses, or if a point cannot be reached. In the last case, planning the motion raises
        an error that names the cause.
        """
        ends = [
            each.to_m
            for each in self.segments
            if isinstance(each, LineSegment) and each.speed_m_s is None and each.blend_m is None
        ]
        if len(ends) < len(self.segments) or len(ends) >= most:
            return None
        try:
            return poses_on_lines(robot, self.near, np.array([self.start_m, *ends]))
        except ConfigError:
            return None

    def sections(self) -> tuple[PathSection, ...]:
        """Return the parts of the path from rest to rest.

        Raises:
            ConfigError: A segment is degenerate, or reverses the direction at a blend; the text
                names it.
        """
        return path_sections(self.start_m, self.segments, self.speed_m_s, self.blend_m)

    def where(self, robot: RobotDescription, sample_period_s: float, row: int) -> str:
        """Return the segment that contains a row of the motion, and the distance into it."""
        rest = max(1, math.ceil(self.dwell_s / sample_period_s))
        for way in self._section_paths(robot):
            rows, _ = plan_speed(self._speed_limits(way, robot), way.joints, robot, sample_period_s)
            if row < rest + len(rows.length):
                return way.section.where(float(rows.length[max(0, row - rest)]))
            row -= rest + len(rows.length)
        return "the end of the path"

    def _samples(self, robot: RobotDescription, sample_period_s: float) -> MotionSamples:
        """Return the joint motion that moves the tool point along the path, from rest to rest."""
        length_m = sum(section.length_m for section in self.sections())
        slowest = min(segment.speed_m_s or self.speed_m_s for segment in self.segments)
        refuse_longer(length_m / slowest, f"{length_m:.4g} m at {slowest:g} m/s")
        rest = max(1, math.ceil(self.dwell_s / sample_period_s))
        pieces: list[JointTrajectory] = []
        for way in self._section_paths(robot):
            _check_positions(way, robot)
            rows, path = plan_speed(
                self._speed_limits(way, robot), way.joints, robot, sample_period_s
            )
            broken = violations(path, robot, sample_period_s)
            if broken:
                middle_m = float(rows.length[len(rows.length) // 2])
                refuse(broken, f"the path, {way.section.where(middle_m)},")
            pieces += [standstill(way.on_grid.position[0], rest), path]
        last = pieces[-1].position[-1]
        whole = join([*pieces, standstill(last, rest)])
        moving = len(whole.position) - 2 * rest
        phase = phases_of((Phase.HOLD, rest), (Phase.MAIN, moving), (Phase.HOLD, rest))
        return MotionSamples(robot.joint_names, sample_period_s, *whole, phase)

    def _section_paths(self, robot: RobotDescription) -> Iterator[_SectionPath]:
        """Yield the joint path of each section, starting from the end pose of the previous one."""
        chain, near, rotation = pose_near_path(robot, self.near)
        pose = reach(chain, np.array(self.start_m), near, rotation, "the start of the path")
        for section in self.sections():
            way = _SectionPath.of(section, chain, rotation, pose)
            pose = way.end
            yield way

    def _speed_limits(self, way: _SectionPath, robot: RobotDescription) -> SpeedLimits:
        """Return the speed limits of a section; refuse a section that is nearly singular."""
        section, grid, joints = way.section, way.grid, way.on_grid
        number = section.piece_at(grid)
        requested = np.array([piece.speed_m_s for piece in section.pieces])[number]
        for j, joint in enumerate(robot.joints):
            share = joint_speed(joints.slope, robot)[:, j] / requested
            worst = int(share.argmin())
            if share[worst] < SLOWEST_SHARE:
                raise ConfigError(
                    f"{section.where(float(grid[worst]))}, is too close to a singular pose: joint"
                    f" {joint.name!r} permits only {1e3 * share[worst] * requested[worst]:.2g} mm/s"
                    " there. Move the path, or start from another pose",
                    code="RID-PATH-SINGULAR",
                )
        curvature = way.points.curvature
        bend = np.linalg.norm(curvature, axis=1)
        inside = number[1:] == number[:-1]
        change = np.linalg.norm(np.diff(curvature, axis=0), axis=1) / np.diff(grid) * inside
        change = np.maximum(np.append(change, 0.0), np.append(0.0, change))
        speed = np.minimum(requested, np.sqrt(self.acceleration_m_s2 / np.maximum(bend, 1e-12)))
        speed = np.minimum(speed, np.cbrt(self.jerk_m_s3 / np.maximum(change, 1e-12)))
        limits = speed_limits(
            grid,
            speed,
            joints.slope,
            joints.bend,
            robot,
            2.0 * self.acceleration_m_s2 / self.jerk_m_s3,
            acceleration=self.acceleration_m_s2,
        )
        if self.keep_speed and (limits.speed < requested * (1.0 - 1e-9)).any():
            _refuse_reduced_speed(way, requested, speed, limits, robot)
        return limits


@dataclass(frozen=True, eq=False)
class _SectionPath:
    """Joint path along one section.

    Attributes:
        section: The section.
        chain: Kinematic chain of the arm.
        rotation: Shape (3, 3). Constant orientation of the flange, if any.
        near: Approximate poses as a function of the length, from which the exact poses are
            computed.
        end: Shape (n,). Pose at the end of the section.
        grid: Shape (m,). Lengths of the checked points [m].
        points: Points of the section on the grid.
        on_grid: Joint positions on the grid.
    """

    section: PathSection
    chain: Chain
    rotation: FloatArray | None
    near: CubicSpline
    end: FloatArray
    grid: FloatArray
    points: PathPoints
    on_grid: PathSlopes

    @classmethod
    def of(
        cls, section: PathSection, chain: Chain, rotation: FloatArray | None, pose: FloatArray
    ) -> _SectionPath:
        """Return the joint path of a section from a pose, by coarse steps and a fine grid."""
        from scipy.interpolate import CubicSpline  # a slow import that few motions need

        lengths = np.linspace(0.0, section.length_m, _grid_points(section, COARSE_M))
        found = np.empty((len(lengths), chain.n))
        coarse = section.at(lengths).point_m
        for k, (length_m, point) in enumerate(zip(lengths.tolist(), coarse, strict=True)):
            pose = reach(chain, point, pose, rotation, f"{section.where(length_m)},")
            found[k] = pose
        near = CubicSpline(lengths, found)
        grid = np.linspace(0.0, section.length_m, _grid_points(section, FINE_M))
        points = section.at(grid)
        on_grid = refine_positions(chain, *points, near(grid), rotation)
        return cls(section, chain, rotation, near, pose, grid, points, on_grid)

    def joints(self, length_m: FloatArray) -> PathSlopes:
        """Return joint positions at lengths, and their derivatives with respect to the length."""
        points = self.section.at(length_m)
        return refine_positions(self.chain, *points, self.near(length_m), self.rotation)


def _grid_points(section: PathSection, spacing_m: float) -> int:
    return 1 + int(np.clip(math.ceil(section.length_m / spacing_m), FEWEST, MOST))


def _check_positions(way: _SectionPath, robot: RobotDescription) -> None:
    position = way.on_grid.position
    for j, joint in enumerate(robot.joints):
        low, high = joint.limits.position_min, joint.limits.position_max
        off = np.maximum(low - position[:, j], position[:, j] - high)
        if off.max() > 0.0:
            row = int(np.argmax(off > 0.0))
            raise ConfigError(
                f"{way.section.where(float(way.grid[row]))}, requires joint {joint.name!r} to"
                f" exceed its limits {low:g} to {high:g} {joint.unit}: it would reach"
                f" {position[off.argmax(), j]:.4g} {joint.unit}. Move the path, or start from"
                " another pose",
                code="RID-PATH-REACH",
            )


def _refuse_reduced_speed(
    way: _SectionPath,
    requested: FloatArray,
    speed: FloatArray,
    limits: SpeedLimits,
    robot: RobotDescription,
) -> None:
    worst = int((limits.speed / requested).argmin())
    by = "acceleration_m_s2 or jerk_m_s3 in the bend"
    if limits.speed[worst] < speed[worst]:
        own = {
            "velocity": joint_speed(way.on_grid.slope, robot)[worst],
            "acceleration": bend_speed(way.on_grid.bend, robot)[worst],
        }
        what = min(own, key=lambda name: float(own[name].min()))
        by = f"the {what} limit of joint {robot.joints[int(own[what].argmin())].name!r}"
    raise ConfigError(
        f"{way.section.where(float(way.grid[worst]))}, cannot keep {requested[worst]:g} m/s: {by}"
        f" permits {limits.speed[worst]:.3g} m/s. Reduce the speed, widen the bend, or remove"
        " keep_speed",
        code="RID-MOTION-LIMIT",
    )
