"""Runs at constant speed, one joint at a time, in both directions over the same range."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field, model_validator

from acquisition.motion.kinds.motion import Motion, Position, Speed, refuse_longer
from acquisition.motion.ramps import QUINTIC_PEAK_VELOCITY, move_duration, rest_to_rest
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
from config.model import ConfigModel
from config.robot.robot import RobotDescription

SHORTEST_RAMP_S: Final = 0.15
SHORTEST_RUN_S: Final = 0.3
MOVE_FRACTION: Final = 0.3


class SpeedRuns(ConfigModel):
    """Speeds of one joint, each run over a range and back.

    Attributes:
        joint: Name of the joint.
        low: Lower end of the range [rad or m].
        high: Upper end of the range [rad or m].
        speeds: Speeds of the runs [rad/s or m/s].
    """

    joint: str
    low: Position
    high: Position
    speeds: tuple[Speed, ...] = Field(min_length=1, max_length=50)

    @model_validator(mode="after")
    def _check_order(self) -> SpeedRuns:
        if self.low >= self.high:
            raise ValueError(f"low {self.low} must be below high {self.high}")
        return self


@dataclass(frozen=True)
class ConstantRun:
    """One run: joint index, signed speed, and the rows at this speed (without row `end`)."""

    joint: int
    speed: float
    first: int
    end: int


@dataclass(frozen=True)
class _Stroke:
    """Numbers of rows (of a ramp, at constant speed), and the start and end position of a run."""

    ramp: int
    constant: int
    start: float
    end: float


class ConstantVelocityMotion(Motion):
    """Runs at constant speeds, one joint at a time, to measure only friction.

    Attributes:
        pose: Pose that the other joints hold, one position per joint, base to flange [rad or m].
        joints: Ranges and speeds of the joints to measure.
        acceleration_fraction: Fraction of the joint's acceleration limit that is used to change the
            speed.
        longest_run_s: Longest time at constant speed in one run [s]. Faster runs use the whole
            range; slower runs use a part around the middle of the range.
        repeats: Number of times that each speed is run forwards and backwards.
        dwell_s: Rest before each run, and at the start and the end of the motion [s].
    """

    kind: Literal["constant_velocity"]
    pose: tuple[Position, ...] = Field(min_length=1)
    joints: tuple[SpeedRuns, ...] = Field(min_length=1)
    acceleration_fraction: Annotated[float, Field(gt=0.0, le=1.0)] = 0.5
    longest_run_s: Annotated[float, Field(ge=1.0, le=600.0)] = 8.0
    repeats: Annotated[int, Field(ge=1, le=100)] = 1
    dwell_s: Annotated[float, Field(ge=0.0, le=60.0)] = 0.2

    def describe(self) -> str:
        """Return a description of the motion in one sentence."""
        runs = sum(2 * self.repeats * len(joint.speeds) for joint in self.joints)
        return f"{runs} runs at constant speed, one joint at a time, both ways."

    def next_command(self, run: Path) -> tuple[object, ...]:
        """Return the command that evaluates the friction in a run."""
        return "friction", run

    def joint_table(self) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        """Return the range and the speeds of each joint."""
        rows: list[tuple[str, ...]] = [
            (
                spec.joint,
                f"{spec.low:.3f}",
                f"{spec.high:.3f}",
                ", ".join(f"{speed:g}" for speed in spec.speeds),
            )
            for spec in self.joints
        ]
        return ("axis", "from", "to", "speeds"), rows

    def runs(
        self, robot: RobotDescription, sample_period_s: float
    ) -> tuple[JointTrajectory, tuple[ConstantRun, ...]]:
        """Return the rows of the whole motion, and the location of each run in these rows.

        Each run accelerates and brakes along the polynomial 10 x^3 - 15 x^4 + 6 x^5, so that the
        motion is of class C2.

        Args:
            robot: Joints and limits.
            sample_period_s: Cycle time of the cell [s].

        Raises:
            ConfigError: The motion does not match the robot, or the ramps of a speed leave no time
                at constant speed.
        """
        if len(self.pose) != len(robot.joints):
            raise ConfigError(
                f"pose has {len(self.pose)} values, but robot {robot.name!r} has"
                f" {len(robot.joints)} joints: give one value per joint",
                code="RID-MOTION-JOINTS",
            )
        pose = np.array(self.pose)
        dwell = max(1, math.ceil(self.dwell_s / sample_period_s))
        pieces = [standstill(pose, dwell)]
        runs: list[ConstantRun] = []
        rows = dwell
        here = pose

        def add(piece: JointTrajectory) -> None:
            nonlocal rows
            pieces.append(piece)
            rows += len(piece.position)

        for spec in self.joints:
            joint = _joint_index(spec, robot)
            for speed in spec.speeds:
                stroke = _plan_stroke(self, spec, robot, joint, speed, sample_period_s)
                to = pose.copy()
                to[joint] = stroke.start
                add(_move_between(here, to, robot, sample_period_s))
                here = to
                for signed in (speed, -speed) * self.repeats:
                    add(standstill(here, dwell))
                    first = rows + stroke.ramp
                    runs.append(ConstantRun(joint, signed, first, first + stroke.constant))
                    add(_run_rows(here, joint, signed, stroke, sample_period_s))
                    here = pose.copy()
                    here[joint] = stroke.end if signed > 0.0 else stroke.start
        add(_move_between(here, pose, robot, sample_period_s))
        add(standstill(pose, dwell))
        return join(pieces), tuple(runs)

    def _samples(self, robot: RobotDescription, sample_period_s: float) -> MotionSamples:
        strokes = sum(2 * self.repeats * len(spec.speeds) for spec in self.joints)
        refuse_longer(strokes * (self.longest_run_s + self.dwell_s), "its runs")
        path, _ = self.runs(robot, sample_period_s)
        phase = phases_of((Phase.MAIN, len(path.position)))
        return MotionSamples(robot.joint_names, sample_period_s, *path, phase)


def _joint_index(spec: SpeedRuns, robot: RobotDescription) -> int:
    if spec.joint not in robot.joint_names:
        raise ConfigError(
            f"the motion runs joint {spec.joint!r}, but robot {robot.name!r} has"
            f" {', '.join(robot.joint_names)}: correct the joint name",
            code="RID-MOTION-JOINTS",
        )
    return robot.joint_names.index(spec.joint)


def _plan_stroke(
    motion: ConstantVelocityMotion,
    spec: SpeedRuns,
    robot: RobotDescription,
    joint: int,
    speed: float,
    sample_period_s: float,
) -> _Stroke:
    """Return the run at one speed, around the middle of the joint's range."""
    allowed = motion.acceleration_fraction * robot.joints[joint].limits.acceleration
    ramp_s = max(SHORTEST_RAMP_S, QUINTIC_PEAK_VELOCITY * speed / allowed)
    ramp = math.ceil(ramp_s / sample_period_s)
    both_ramps = speed * ramp * sample_period_s
    constant_s = min(motion.longest_run_s, (spec.high - spec.low - both_ramps) / speed)
    constant = math.floor(constant_s / sample_period_s + 1e-9)
    if constant * sample_period_s < SHORTEST_RUN_S:
        raise ConfigError(
            f"joint {spec.joint!r}: at {speed:g} per second the ramps leave"
            f" {max(constant_s, 0.0):.3g} s of constant speed between {spec.low:g} and"
            f" {spec.high:g}, but at least {SHORTEST_RUN_S:g} s are needed: widen low and high,"
            " or reduce the speed",
            code="RID-MOTION-STROKE",
        )
    half = 0.5 * (both_ramps + speed * constant * sample_period_s)
    middle = 0.5 * (spec.low + spec.high)
    return _Stroke(ramp, constant, middle - half, middle + half)


def _run_rows(
    start: FloatArray, joint: int, speed: float, stroke: _Stroke, sample_period_s: float
) -> JointTrajectory:
    """Return one run: acceleration, constant speed, and braking up to the rest (not included)."""
    ramp_s = stroke.ramp * sample_period_s
    x = np.arange(stroke.ramp) / stroke.ramp
    up, down = _ramp_profile(x), _ramp_profile(1.0 - x)
    along = 0.5 * ramp_s + sample_period_s * np.arange(stroke.constant)
    whole = ramp_s + sample_period_s * stroke.constant
    steady = np.ones(stroke.constant)
    path = np.concatenate([ramp_s * up[0], along, whole - ramp_s * down[0]])
    rate = np.concatenate([up[1], steady, down[1]])
    change = np.concatenate([up[2] / ramp_s, 0.0 * steady, -down[2] / ramp_s])
    of_joint = speed * np.eye(len(start))[joint]
    columns = (np.outer(values, of_joint) for values in (path, rate, change))
    position, velocity, acceleration = columns
    return JointTrajectory(start + position, velocity, acceleration)


def _ramp_profile(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the integral of the rate, the rate and its derivative, over a ramp of length 1."""
    return (
        x**4 * (2.5 - 3.0 * x + x**2),
        x**3 * (10.0 - 15.0 * x + 6.0 * x**2),
        30.0 * x**2 * (1.0 - x) ** 2,
    )


def _move_between(
    start: FloatArray, end: FloatArray, robot: RobotDescription, sample_period_s: float
) -> JointTrajectory:
    """Return a slow move between two poses."""
    seconds = move_duration(end - start, robot, MOVE_FRACTION)
    return rest_to_rest(start, end, max(1, math.ceil(seconds / sample_period_s)), sample_period_s)
