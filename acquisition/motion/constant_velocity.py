"""Runs at constant speed, one joint at a time, forwards and backwards over the same stretch."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from acquisition.motion.ramps import (
    QUINTIC_PEAK_VELOCITY,
    Path,
    join,
    rest_to_rest,
    rest_to_rest_duration,
    standstill,
)
from config.arrays import FloatArray
from config.errors import ConfigError
from config.motion.motion import ConstantVelocityMotion, SpeedRuns
from config.robot.robot import RobotDescription

SHORTEST_RAMP_S = 0.15
SHORTEST_RUN_S = 0.3
MOVE_FRACTION = 0.3


@dataclass(frozen=True)
class ConstantRun:
    """One run of one joint (from 0): its signed speed, and the rows at that speed, end excluded."""

    joint: int
    speed: float
    first: int
    end: int


@dataclass(frozen=True)
class _Stroke:
    """One way of one run: rows of each ramp and at constant speed, and where it begins and ends."""

    ramp: int
    constant: int
    start: float
    end: float


def constant_velocity_runs(
    motion: ConstantVelocityMotion, robot: RobotDescription, sample_period_s: float
) -> tuple[Path, tuple[ConstantRun, ...]]:
    """Return the samples of all runs, and which rows belong to which.

    A speed is reached and left along the polynomial 10 x^3 - 15 x^4 + 6 x^5, so the motion is of
    class C2.

    Raises
    ------
    ConfigError
        The motion does not fit the robot, or a speed leaves no time between its ramps.
    """
    if len(motion.pose) != len(robot.joints):
        raise ConfigError(
            f"pose has {len(motion.pose)} values, robot {robot.name!r} has {len(robot.joints)}"
            " joints"
        )
    pose = np.array(motion.pose)
    dwell = max(1, math.ceil(motion.dwell_s / sample_period_s))
    pieces = [standstill(pose, dwell)]
    runs: list[ConstantRun] = []
    rows = dwell
    here = pose

    def add(piece: Path) -> None:
        nonlocal rows
        pieces.append(piece)
        rows += len(piece.position)

    for spec in motion.joints:
        joint = _joint(spec, robot)
        for speed in spec.speeds:
            stroke = _stroke(motion, spec, robot, joint, speed, sample_period_s)
            to = pose.copy()
            to[joint] = stroke.start
            add(_move(here, to, robot, sample_period_s))
            here = to
            for signed in (speed, -speed) * motion.repeats:
                add(standstill(here, dwell))
                first = rows + stroke.ramp
                runs.append(ConstantRun(joint, signed, first, first + stroke.constant))
                add(_run(here, joint, signed, stroke, sample_period_s))
                here = pose.copy()
                here[joint] = stroke.end if signed > 0.0 else stroke.start
    add(_move(here, pose, robot, sample_period_s))
    add(standstill(pose, dwell))
    return join(pieces), tuple(runs)


def duration_s(motion: ConstantVelocityMotion) -> float:
    """Return the longest that the runs themselves may take, before any sample of them is made."""
    runs = sum(2 * motion.repeats * len(spec.speeds) for spec in motion.joints)
    return runs * (motion.longest_run_s + motion.dwell_s)


def _joint(spec: SpeedRuns, robot: RobotDescription) -> int:
    if spec.joint not in robot.joint_names:
        raise ConfigError(
            f"the motion runs joint {spec.joint!r}; robot {robot.name!r} has"
            f" {', '.join(robot.joint_names)}"
        )
    return robot.joint_names.index(spec.joint)


def _stroke(
    motion: ConstantVelocityMotion,
    spec: SpeedRuns,
    robot: RobotDescription,
    joint: int,
    speed: float,
    sample_period_s: float,
) -> _Stroke:
    """Return ramps and constant part of one speed, around the middle of its range."""
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
            f" {spec.high:g}, {SHORTEST_RUN_S:g} s are the least: widen low and high, or run slower"
        )
    half = 0.5 * (both_ramps + speed * constant * sample_period_s)
    middle = 0.5 * (spec.low + spec.high)
    return _Stroke(ramp, constant, middle - half, middle + half)


def _run(
    start: FloatArray, joint: int, speed: float, stroke: _Stroke, sample_period_s: float
) -> Path:
    """Return one way: up to the speed, along it, down to rest (which is not included)."""
    ramp_s = stroke.ramp * sample_period_s
    x = np.arange(stroke.ramp) / stroke.ramp
    up, down = _ramp(x), _ramp(1.0 - x)
    along = 0.5 * ramp_s + sample_period_s * np.arange(stroke.constant)
    whole = ramp_s + sample_period_s * stroke.constant
    steady = np.ones(stroke.constant)
    path = np.concatenate([ramp_s * up[0], along, whole - ramp_s * down[0]])
    rate = np.concatenate([up[1], steady, down[1]])
    change = np.concatenate([up[2] / ramp_s, 0.0 * steady, -down[2] / ramp_s])
    of_joint = speed * np.eye(len(start))[joint]
    columns = (np.outer(values, of_joint) for values in (path, rate, change))
    position, velocity, acceleration = columns
    return Path(start + position, velocity, acceleration)


def _ramp(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the integral of the rate, the rate and its derivative, over a ramp of length 1."""
    return (
        x**4 * (2.5 - 3.0 * x + x**2),
        x**3 * (10.0 - 15.0 * x + 6.0 * x**2),
        30.0 * x**2 * (1.0 - x) ** 2,
    )


def _move(
    start: FloatArray, end: FloatArray, robot: RobotDescription, sample_period_s: float
) -> Path:
    """Return a gentle move between two poses."""
    velocity = MOVE_FRACTION * np.array([joint.limits.velocity for joint in robot.joints])
    acceleration = MOVE_FRACTION * np.array([joint.limits.acceleration for joint in robot.joints])
    seconds = rest_to_rest_duration(end - start, velocity, acceleration)
    return rest_to_rest(start, end, max(1, math.ceil(seconds / sample_period_s)), sample_period_s)
