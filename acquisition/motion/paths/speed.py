"""Speed along a path within all limits, smooth in time.

A forward and a backward pass over the squared speed respect the requested limits and those of the
joints (Bobrow, Dubowsky and Gibson 1985). Two moving averages over time limit the jerk. Each limit
is extended along the path by the distance over which the averages act, so that the averaged speed
respects it too.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from acquisition.motion.limits import violations
from acquisition.motion.samples import JointTrajectory
from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import WristCoupling
from dynamics.geometry.inverse_kinematics import PathSlopes

SHARE_OF_BENDS: Final = 0.7
FINE: Final = 8
SECOND_AVERAGE: Final = 0.5
MARGIN: Final = 0.97
TINY: Final = 1e-12
SLOWER: Final = 0.95
ATTEMPTS: Final = 30


class SpeedProfile(NamedTuple):
    """Motion along a path, row by row: s, ds/dt and d2s/dt2, each of shape (rows,)."""

    length: FloatArray
    speed: FloatArray
    acceleration: FloatArray


@dataclass(frozen=True, eq=False)
class SpeedLimits:
    """Limits of the speed on a grid along a path, in the path's unit of length.

    Attributes:
        length: Shape (m,). Grid, from 0.
        speed: Shape (m,). Largest speed, per second.
        steady, per_speed: Shape (m, n). The largest change of the speed is the smallest of the n
            values `steady - per_speed * speed^2`, per second squared.
        smoothing_s: Time over which the change of the speed is averaged [s].
    """

    length: FloatArray
    speed: FloatArray
    steady: FloatArray
    per_speed: FloatArray
    smoothing_s: float

    def slower(self, factor: float) -> SpeedLimits:
        """Return limits for a motion that takes about `1 / factor` times as long."""
        return replace(self, speed=factor * self.speed, steady=factor**2 * self.steady)


def joint_speed(slope: FloatArray, robot: RobotDescription, fraction: float = 1.0) -> FloatArray:
    """Return the path speeds at which joints or motors reach their limits, (m, n).

    The limits are multiplied by `fraction` and by 97 %.
    """
    coupling = WristCoupling.of_robot(robot)
    if coupling is not None:
        slope = np.maximum(np.abs(slope), np.abs(coupling.to_motors(slope)))
    limit = fraction * MARGIN * np.array([joint.limits.velocity for joint in robot.joints])
    return np.asarray(limit / np.maximum(np.abs(slope), TINY))


def bend_speed(bend: FloatArray, robot: RobotDescription, fraction: float = 1.0) -> FloatArray:
    """Return the speeds at which bends need a fixed part of each joint's acceleration, (m, n)."""
    limit = _acceleration_limits(robot, fraction)
    return np.asarray(np.sqrt(SHARE_OF_BENDS * limit / np.maximum(np.abs(bend), TINY)))


def speed_limits(
    length: FloatArray,
    speed: FloatArray,
    slope: FloatArray,
    bend: FloatArray,
    robot: RobotDescription,
    smoothing_s: float,
    *,
    acceleration: float = math.inf,
    fraction: float = 1.0,
) -> SpeedLimits:
    """Return the speed limits of a path: the requested ones and those of the joints.

    Args:
        length: Shape (m,). Grid.
        speed: Shape (m,). Requested speed.
        slope, bend: Shape (m, n). First and second derivative of the joint positions with respect
            to the length.
        robot: Joint limits.
        smoothing_s: Time over which the change of the speed is averaged [s].
        acceleration: Largest requested change of the speed, per second squared.
        fraction: Fraction of the joint limits that is used.
    """
    joints = np.minimum(joint_speed(slope, robot, fraction), bend_speed(bend, robot, fraction))
    size = np.maximum(np.abs(slope), TINY)
    asked = np.full((len(length), 1), acceleration)
    return SpeedLimits(
        length=length,
        speed=np.minimum(speed, joints.min(axis=1)),
        steady=np.concatenate([asked, _acceleration_limits(robot, fraction) / size], axis=1),
        per_speed=np.concatenate([0.0 * length[:, np.newaxis], np.abs(bend) / size], axis=1),
        smoothing_s=smoothing_s,
    )


def speed_profile(limits: SpeedLimits, sample_period_s: float) -> SpeedProfile:
    """Return a fast and smooth motion along a path within its limits, from rest to rest.

    Args:
        limits: Limits of the speed.
        sample_period_s: Time between rows [s].

    Returns:
        Rows of the motion; the last one is at rest at the end of the path.
    """
    speed = _forward_and_backward_passes(limits)
    step_s = sample_period_s / FINE
    steps = np.diff(limits.length)
    time_s = np.concatenate([[0.0], np.cumsum(2.0 * steps / (speed[1:] + speed[:-1]))])
    first = max(1, round(limits.smoothing_s / step_s))
    second = max(1, round(SECOND_AVERAGE * limits.smoothing_s / step_s))
    cells = math.ceil(time_s[-1] / step_s) + 1
    cells += -(cells + first + second - 2) % FINE
    at_s = np.minimum(np.arange(cells + 1) * step_s, time_s[-1])
    k = np.clip(np.searchsorted(time_s, at_s, "right") - 1, 0, len(steps) - 1)
    into_s = at_s - time_s[k]
    change = np.diff(speed**2)[k] / (2.0 * steps[k])
    raw = limits.length[k] + into_s * (speed[k] + 0.5 * change * into_s)
    raw[at_s >= time_s[-1]] = limits.length[-1]
    moved = np.diff(raw)
    for width in (first, second):
        moved = np.convolve(moved, np.full(width, 1.0 / width))
    length = np.concatenate([[0.0], np.cumsum(moved)])
    rate = np.concatenate([[0.0], moved, [0.0]]) / step_s
    fine = SpeedProfile(length, 0.5 * (rate[1:] + rate[:-1]), np.diff(rate) / step_s)
    rows = SpeedProfile(*(values[::FINE].copy() for values in fine))
    rows.length[-1] = limits.length[-1]
    for values in rows[1:]:
        values[[0, -1]] = 0.0
    return rows


def plan_speed(
    limits: SpeedLimits,
    joints_at: Callable[[FloatArray], PathSlopes],
    robot: RobotDescription,
    sample_period_s: float,
) -> tuple[SpeedProfile, JointTrajectory]:
    """Return the motion along a path, slow enough for the joint limits also between rows.

    Args:
        limits: Initial limits of the speed.
        joints_at: Returns the joint positions, and their derivatives with respect to the length, at
            lengths of the path.
        robot: Joint limits.
        sample_period_s: Cycle time of the cell [s].

    Returns:
        One row per cycle. After `ATTEMPTS` attempts a limit may still be exceeded.
    """
    attempts = 0
    while True:
        rows = speed_profile(limits, sample_period_s)
        joints = joints_at(rows.length)
        speed = rows.speed[:, np.newaxis]
        path = JointTrajectory(
            joints.position,
            joints.slope * speed,
            joints.bend * speed**2 + joints.slope * rows.acceleration[:, np.newaxis],
        )
        attempts += 1
        if attempts == ATTEMPTS or not violations(path, robot, sample_period_s, 2):
            return rows, path
        limits = limits.slower(SLOWER)


def _acceleration_limits(robot: RobotDescription, fraction: float) -> FloatArray:
    limits = [joint.limits.acceleration for joint in robot.joints]
    return np.asarray(fraction * MARGIN * np.array(limits))


def _forward_and_backward_passes(limits: SpeedLimits) -> FloatArray:
    """Return the fastest speed at each grid point of a motion from rest to rest."""
    most = _extend_limits(limits) ** 2
    most[0] = most[-1] = 0.0
    steps = np.diff(limits.length)
    for order in (range(len(steps)), range(len(steps) - 1, -1, -1)):
        forwards = order.step > 0
        for k in order:
            here, there = (k, k + 1) if forwards else (k + 1, k)
            change = float((limits.steady[here] - limits.per_speed[here] * most[here]).min())
            most[there] = min(most[there], most[here] + 2.0 * steps[k] * max(change, 0.0))
    return np.asarray(np.sqrt(most))


def _extend_limits(limits: SpeedLimits) -> FloatArray:
    """Return the speed limits, each extended by the distance over which the averages act."""
    reach_s = 0.5 * (1.0 + SECOND_AVERAGE) * limits.smoothing_s
    gain = np.minimum(limits.steady.min(axis=1) * reach_s, limits.speed.max())
    reach = reach_s * (limits.speed + gain)
    begin = np.searchsorted(limits.length, limits.length - reach)
    end = np.searchsorted(limits.length, limits.length + reach, "right")
    widened = limits.speed.copy()
    for low, high, speed in zip(begin.tolist(), end.tolist(), limits.speed.tolist(), strict=True):
        np.minimum(widened[low:high], speed, out=widened[low:high])
    return np.asarray(widened)
