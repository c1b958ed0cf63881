"""Joint path with its timing in every cycle, as `rid-daq retime` writes it."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field, model_validator

from acquisition.motion.kinds.motion import LONGEST_MOTION_S, Motion, Position, Seconds
from acquisition.motion.paths.joint_spline import joint_spline
from acquisition.motion.samples import (
    JointTrajectory,
    MotionSamples,
    Phase,
    join,
    phases_of,
    standstill,
)
from config.errors import ConfigError
from config.model import ConfigModel
from config.robot.robot import RobotDescription

SAME_CYCLE: Final = 1e-9
MOST_ROWS: Final = 200_000

Rest = Annotated[float, Field(ge=0.0, le=LONGEST_MOTION_S)]
Row = Annotated[tuple[float, ...], Field(min_length=3, max_length=MOST_ROWS)]


class TimedWay(ConfigModel):
    """Part of a path from rest to rest: a smooth curve (of class C2) through poses, and its rows.

    Attributes:
        points: Poses on the curve, each with one position per joint, base to flange [rad or m].
        length: Length of the curve at each pose, increasing, in an arbitrary unit.
        place: Length along the curve in each cycle, in the same unit.
        speed: First derivative of `place` [unit/s].
        acceleration: Second derivative of `place` [unit/s²].
        rest_s: Rest at the end [s].
    """

    points: tuple[tuple[Position, ...], ...] = Field(min_length=2, max_length=10_000)
    length: tuple[float, ...] = Field(min_length=2, max_length=10_000)
    place: Row
    speed: Row
    acceleration: Row
    rest_s: Rest = 0.2

    @model_validator(mode="after")
    def _check_rows(self) -> TimedWay:
        if len(self.length) != len(self.points):
            raise ValueError(
                f"length has {len(self.length)} values, points {len(self.points)}:"
                " give the same number"
            )
        if not all(begin < end for begin, end in pairwise(self.length)):
            raise ValueError("length must increase")
        if len({len(self.place), len(self.speed), len(self.acceleration)}) != 1:
            raise ValueError("place, speed and acceleration must have the same number of rows")
        if min(self.place) < self.length[0] or max(self.place) > self.length[-1]:
            raise ValueError("place must be between the first and the last length")
        ends = (self.speed[0], self.speed[-1], self.acceleration[0], self.acceleration[-1])
        if any(ends):
            raise ValueError("speed and acceleration must be 0 in the first and the last row")
        return self


class TimedPathMotion(Motion):
    """Timed parts of a joint path, made for one cycle time by `rid-daq retime`.

    The rows respect all limits for which they were made; another cycle time, model or other limits
    require new rows.

    Attributes:
        cycle_time_s: Cycle time for which the rows were made [s].
        rest_s: Rest before the first part [s].
        ways: Parts of the path, in their order.
    """

    kind: Literal["timed_path"]
    cycle_time_s: Seconds
    rest_s: Rest = 0.2
    ways: tuple[TimedWay, ...] = Field(min_length=1, max_length=1000)

    def describe(self) -> str:
        """Return a description of the motion in one sentence."""
        moving_s = sum(len(way.place) - 1 for way in self.ways) * self.cycle_time_s
        cycle_ms = 1e3 * self.cycle_time_s
        return f"A path timed to {moving_s:.4g} s of motion, at a cycle time of {cycle_ms:g} ms."

    def next_command(self, run: Path) -> tuple[object, ...]:
        """Return the command that evaluates the path error of a run."""
        return "tracking", run

    def _samples(self, robot: RobotDescription, sample_period_s: float) -> MotionSamples:
        if abs(sample_period_s - self.cycle_time_s) > SAME_CYCLE:
            raise ConfigError(
                f"the path was timed for cycles of {1e3 * self.cycle_time_s:g} ms, but this cell"
                f" has {1e3 * sample_period_s:g} ms: make it again with `rid-daq retime`",
                code="RID-MOTION-CYCLE",
            )
        n = len(robot.joints)
        for number, way in enumerate(self.ways, start=1):
            if any(len(point) != n for point in way.points):
                raise ConfigError(
                    f"part {number} of the path has poses with another number of values than the"
                    f" {n} joints of robot {robot.name!r}: make it again with `rid-daq retime`",
                    code="RID-MOTION-JOINTS",
                )
        rest = max(1, math.ceil(self.rest_s / sample_period_s - 1e-9))
        paths = [_joint_trajectory(way) for way in self.ways]
        pieces = [standstill(paths[0].position[0], rest)]
        for way, path in zip(self.ways, paths, strict=True):
            rows = max(1, math.ceil(way.rest_s / sample_period_s - 1e-9))
            pieces += [path, standstill(path.position[-1], rows)]
        whole = join(pieces)
        last = len(pieces[-1].position)
        moving = len(whole.position) - rest - last
        phase = phases_of((Phase.HOLD, rest), (Phase.MAIN, moving), (Phase.HOLD, last))
        return MotionSamples(robot.joint_names, sample_period_s, *whole, phase)


def _joint_trajectory(way: TimedWay) -> JointTrajectory:
    curve = joint_spline(np.array(way.length), np.array(way.points))
    place = np.array(way.place)
    speed, change = (np.array(row)[:, np.newaxis] for row in (way.speed, way.acceleration))
    position, slope, bend = (np.asarray(curve(place, order)) for order in range(3))
    return JointTrajectory(position, slope * speed, slope * change + bend * speed**2)
