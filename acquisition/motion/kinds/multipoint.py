"""Multi-point motion: smooth moves through random poses, for the validation of a model."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from acquisition.motion.kinds.motion import Motion
from acquisition.motion.kinds.pose_sequence import visit_poses
from acquisition.motion.samples import MotionSamples
from config.arrays import FloatArray
from config.errors import ConfigError
from config.robot.bodies import Workspace
from config.robot.robot import RobotDescription

MOST_DRAWS: Final = 50
CLEAR_STEP: Final = 0.05
CLEARANCE_M: Final = 0.025
"""`MOST_DRAWS`: largest number of draws, divided by the number of poses. `CLEAR_STEP`: step of the
collision check [rad or m]. `CLEARANCE_M`: smallest distance between bodies [m].
"""


class MultipointMotion(Motion):
    """Smooth point-to-point motion through random poses, for validation.

    A pose is drawn again if the move to it would bring two bodies of the robot too close.

    Attributes:
        points: Number of random poses.
        seed: Random seed of the poses.
        range_fraction: Fraction of each joint's range, around its middle, in which poses are drawn.
        speed_fraction: Fraction of the joints' velocity and acceleration limits that is used. The
            slowest joint decides the duration of a move.
        dwell_s: Rest at each pose [s].
    """

    kind: Literal["multipoint"]
    points: Annotated[int, Field(ge=2, le=1000)] = 20
    seed: Annotated[int, Field(ge=0)]
    range_fraction: Annotated[float, Field(gt=0.0, le=1.0)] = 0.8
    speed_fraction: Annotated[float, Field(gt=0.0, le=1.0)] = 0.7
    dwell_s: Annotated[float, Field(ge=0.0, le=60.0)] = 0.1

    def describe(self) -> str:
        """Return a description of the motion in one sentence."""
        return f"Smooth moves through {self.points} random points (seed {self.seed})."

    def next_command(self, run: Path) -> tuple[object, ...]:
        """Return the command that validates a model."""
        return "validate", "MODEL", run

    def draw_poses(self, robot: RobotDescription) -> FloatArray:
        """Return the poses of the motion, which are the same for the same seed.

        Each joint is drawn uniformly from the middle `range_fraction` of its limits.

        Returns:
            Shape (points, joints). Poses [rad or m].

        Raises:
            ConfigError: Among `MOST_DRAWS` draws per pose, too few poses can be reached without
                self-collision.
        """
        low = np.array([joint.limits.position_min for joint in robot.joints])
        high = np.array([joint.limits.position_max for joint in robot.joints])
        middle, half = (low + high) / 2.0, (high - low) / 2.0 * self.range_fraction
        random = np.random.default_rng(self.seed)
        from dynamics.geometry.clearances import Clearances  # coal, which few motions need

        clearances = Clearances.of(robot, Workspace(clearance_m=CLEARANCE_M))
        poses: list[FloatArray] = []
        for _ in range(MOST_DRAWS * self.points):
            pose = middle + half * random.uniform(-1.0, 1.0, len(low))
            if clearances.is_clear(pose[np.newaxis]) and (
                not poses or clearances.is_clear(straight_line(poses[-1], pose))
            ):
                poses.append(pose)
            if len(poses) == self.points:
                return np.array(poses)
        raise ConfigError(
            f"robot {robot.name!r}: only {len(poses)} of {MOST_DRAWS * self.points} random points"
            f" can be reached without self-collision, but {self.points} are requested: request"
            " fewer points, use another seed or a smaller range_fraction, or check `bodies` in"
            " the robot file",
            code="RID-DESIGN-NONE",
        )

    def _samples(self, robot: RobotDescription, sample_period_s: float) -> MotionSamples:
        """Return moves through the poses, with a dwell at each pose."""
        return visit_poses(
            self.draw_poses(robot),
            robot,
            sample_period_s,
            speed_fraction=self.speed_fraction,
            dwell_s=self.dwell_s,
        )


def straight_line(start: FloatArray, end: FloatArray) -> FloatArray:
    """Return poses (samples, joints) on the straight line between two poses, ends included."""
    steps = max(1, math.ceil(float(np.abs(end - start).max()) / CLEAR_STEP))
    share = np.linspace(0.0, 1.0, steps + 1)[:, np.newaxis]
    return np.asarray(start + share * (end - start))
