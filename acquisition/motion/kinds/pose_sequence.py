"""Sequence of poses: a rest at each, and smooth moves in between."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from acquisition.motion.kinds.motion import Motion, Poses, Position, refuse_longer
from acquisition.motion.ramps import move_duration, rest_to_rest
from acquisition.motion.samples import MotionSamples, Phase, join, phases_of, standstill
from config.arrays import FloatArray
from config.errors import ConfigError, LimitError
from config.robot.robot import RobotDescription

MOST_POSES: Final = 1000


class PoseSequenceMotion(Motion):
    """Rests at given poses, for measurements with another instrument, with smooth moves between.

    Attributes:
        points: Poses, each with one position per joint, base to flange [rad or m].
        speed_fraction: Fraction of the joints' velocity and acceleration limits that is used. The
            slowest joint decides the duration of a move.
        dwell_s: Rest at each pose [s].
    """

    kind: Literal["pose_sequence"]
    points: tuple[tuple[Position, ...], ...] = Field(min_length=2, max_length=MOST_POSES)
    speed_fraction: Annotated[float, Field(gt=0.0, le=1.0)] = 0.3
    dwell_s: Annotated[float, Field(ge=0.0, le=600.0)] = 5.0

    def describe(self) -> str:
        """Return a description of the motion in one sentence."""
        return f"Rests of {self.dwell_s:g} s at {len(self.points)} poses."

    def next_command(self, run: Path) -> tuple[object, ...]:
        """Return the command that evaluates the path error of a run."""
        return "tracking", run

    def chosen_poses(self, robot: RobotDescription, most: int) -> Poses | None:
        """Return the poses of the file; None if there are more than `most`."""
        return None if len(self.points) > most else self.points

    def _samples(self, robot: RobotDescription, sample_period_s: float) -> MotionSamples:
        """Return the rests and the moves between them.

        Raises:
            ConfigError: A pose has another number of values than the robot has joints.
            LimitError: A pose is outside the limits.
        """
        return visit_poses(
            reachable_poses(self.points, robot),
            robot,
            sample_period_s,
            speed_fraction=self.speed_fraction,
            dwell_s=self.dwell_s,
        )


def reachable_poses(points: Sequence[Sequence[float]], robot: RobotDescription) -> FloatArray:
    """Return the poses of a motion file, shape (poses, joints).

    Raises:
        ConfigError: A pose has another number of values than the robot has joints.
        LimitError: A pose is outside the limits.
    """
    for number, point in enumerate(points, start=1):
        if len(point) != len(robot.joints):
            raise ConfigError(
                f"point {number} has {len(point)} values, but robot {robot.name!r} has"
                f" {len(robot.joints)} joints: give one value per joint",
                code="RID-MOTION-JOINTS",
            )
        for joint, value in zip(robot.joints, point, strict=True):
            low, high = joint.limits.position_min, joint.limits.position_max
            if not low <= value <= high:
                raise LimitError(
                    f"point {number} has joint {joint.name!r} at {value:.4g} {joint.unit}, outside"
                    f" its limits {low:g} to {high:g} {joint.unit}: move the point",
                    code="RID-MOTION-LIMIT",
                )
    return np.array(points, dtype=float)


def visit_poses(
    poses: FloatArray,
    robot: RobotDescription,
    sample_period_s: float,
    *,
    speed_fraction: float,
    dwell_s: float,
) -> MotionSamples:
    """Return quintic moves from pose to pose, with a rest at each pose.

    A move takes the time that its slowest joint or motor needs at `speed_fraction` of its limits,
    rounded up to whole samples.

    Args:
        poses: Shape (poses, joints). Poses within the limits [rad or m].
        robot: Limits and names of the joints.
        sample_period_s: Time between rows [s].
        speed_fraction: Fraction of the velocity and acceleration limits.
        dwell_s: Rest at each pose [s].

    Raises:
        ConfigError: The motion takes too long.
    """
    moves_s = [
        move_duration(end - start, robot, speed_fraction)
        for start, end in itertools.pairwise(poses)
    ]
    what = f"{len(poses)} points at {speed_fraction:g} times the joints' speed limits"
    refuse_longer(sum(moves_s) + len(poses) * dwell_s, what)
    dwell = max(1, math.ceil(dwell_s / sample_period_s))
    pieces = [standstill(poses[0], dwell)]
    for (start, end), duration_s in zip(itertools.pairwise(poses), moves_s, strict=True):
        samples = max(1, math.ceil(duration_s / sample_period_s))
        pieces.append(rest_to_rest(start, end, samples, sample_period_s))
        pieces.append(standstill(end, dwell))
    path = join(pieces)
    phase = phases_of((Phase.MAIN, len(path.position)))
    return MotionSamples(robot.joint_names, sample_period_s, *path, phase)
