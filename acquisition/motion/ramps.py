"""Ramps: from rest to a periodic motion and back, and from rest to rest between poses.

A run-in moves along the periodic path with increasing rate: q(t) = f(s(t)). Here f is the periodic
motion, and the rate ds/dt rises from 0 to 1 as the polynomial 10 x^3 - 15 x^4 + 6 x^5 of the
elapsed fraction x. The positions stay within those of the period, the joint speeds do not exceed
those of the period, and the motion is of class C3. A run-out is the same motion reversed in time.
"""

from __future__ import annotations

import math

import numpy as np

from acquisition.motion.fourier import FourierTrajectory
from acquisition.motion.samples import JointTrajectory
from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import WristCoupling

QUINTIC_PEAK_VELOCITY = 15.0 / 8.0
QUINTIC_PEAK_ACCELERATION = 10.0 / math.sqrt(3.0)


def run_in(trajectory: FourierTrajectory, samples: int) -> JointTrajectory:
    """Return the samples from rest up to the start of the first period, which is not included.

    Args:
        trajectory: The periodic motion; the run-in ends at its time zero.
        samples: Number of samples of the run-in; the path time advances by half of this number.
    """
    x = np.arange(samples) / samples
    duration_s = samples * trajectory.sample_period_s
    return _at_path_time(trajectory, -0.5 * duration_s, x, duration_s)


def run_out(trajectory: FourierTrajectory, samples: int) -> JointTrajectory:
    """Return the samples from the end of the last period to rest, both included.

    Args:
        trajectory: The periodic motion; the run-out begins at its time zero, the end of a period.
        samples: Number of samples of the run-out; one more row, at rest, is returned.
    """
    x = 1.0 - np.arange(samples + 1) / samples
    duration_s = samples * trajectory.sample_period_s
    # The run-out is the time-reversed run-in of the time-reversed motion (s -> -s); the signs of
    # the speeds change twice and thus remain.
    return _at_path_time(trajectory, 0.5 * duration_s, x, -duration_s)


def _at_path_time(
    trajectory: FourierTrajectory, start_s: float, x: FloatArray, duration_s: float
) -> JointTrajectory:
    """Return the trajectory at s(x) = start + duration * integral of the rate from 0 to x."""
    clock_s = start_s + duration_s * (2.5 * x**4 - 3.0 * x**5 + x**6)
    rate = (x**3 * (10.0 - 15.0 * x + 6.0 * x**2))[:, np.newaxis]
    rate_change = (30.0 * x**2 * (1.0 - x) ** 2 / duration_s)[:, np.newaxis]
    velocity = trajectory.velocity(clock_s)
    return JointTrajectory(
        position=trajectory.position(clock_s),
        velocity=velocity * rate,
        acceleration=trajectory.acceleration(clock_s) * rate**2 + velocity * rate_change,
    )


def rest_to_rest_duration(
    travel: FloatArray, velocity_limit: FloatArray, acceleration_limit: FloatArray
) -> float:
    """Return the shortest time [s] of a quintic move in which no joint exceeds its limits.

    Args:
        travel: Shape (joints,). Distance of each joint [rad or m].
        velocity_limit, acceleration_limit: Shape (joints,). Limits, per second and per second
            squared.
    """
    distance = np.abs(travel)
    by_velocity = QUINTIC_PEAK_VELOCITY * distance / velocity_limit
    by_acceleration = np.sqrt(QUINTIC_PEAK_ACCELERATION * distance / acceleration_limit)
    return float(np.maximum(by_velocity, by_acceleration).max())


def move_duration(travel: FloatArray, robot: RobotDescription, fraction: float) -> float:
    """Return the shortest time [s] of a quintic move within a fraction of a robot's limits.

    Args:
        travel: Shape (joints,). Distance of each joint [rad or m].
        robot: Limits of the joints, and speed limits of coupled motors.
        fraction: Fraction of the velocity and acceleration limits.
    """
    velocity = fraction * np.array([joint.limits.velocity for joint in robot.joints])
    acceleration = fraction * np.array([joint.limits.acceleration for joint in robot.joints])
    duration_s = rest_to_rest_duration(travel, velocity, acceleration)
    coupling = WristCoupling.of_robot(robot)
    if coupling is None:
        return duration_s
    unlimited = np.full(len(velocity), math.inf)
    of_motors_s = rest_to_rest_duration(coupling.to_motors(travel), velocity, unlimited)
    return max(duration_s, of_motors_s)


def rest_to_rest(
    start: FloatArray, end: FloatArray, samples: int, sample_period_s: float
) -> JointTrajectory:
    """Return a quintic move of class C2 between two poses at rest, synchronous in all joints.

    Args:
        start, end: Shape (joints,). Poses [rad or m].
        samples: Number of rows from the start (included) to the end (not included).
        sample_period_s: Time between rows [s].
    """
    x = (np.arange(samples) / samples)[:, np.newaxis]
    duration_s = samples * sample_period_s
    travel = end - start
    return JointTrajectory(
        position=start + travel * (x**3 * (10.0 - 15.0 * x + 6.0 * x**2)),
        velocity=travel / duration_s * (30.0 * x**2 * (1.0 - x) ** 2),
        acceleration=travel / duration_s**2 * (60.0 * x * (1.0 - x) * (1.0 - 2.0 * x)),
    )
