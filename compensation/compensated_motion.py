"""A motion with a model of the robot: its torque and its feedforward."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from acquisition.motion.motion_file import AnyMotion
from acquisition.motion.samples import MotionSamples, Phase
from compensation.feedforward.inverse import (
    FeedforwardTuning,
    periodic_feedforward,
    rest_to_rest_feedforward,
)
from compensation.loops.velocity_loop import VelocityLoop, in_order
from config.arrays import FloatArray
from config.errors import LimitError
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import WristCoupling
from identification.estimation.estimate import Estimate, predict
from identification.estimation.limit_torque import limit_torque

BLEND_S: Final = 0.3


def compensated_motion(
    samples: MotionSamples,
    estimate: Estimate,
    loops: Sequence[VelocityLoop],
    tuning: FeedforwardTuning | None = None,
) -> MotionSamples:
    """Return the motion with its precompensated feedforward.

    The compensation is computed in the frequency domain. One period is computed separately, so that
    the feedforward of all periods is equal. The whole motion is computed as one long period; a
    return to its start closes this period.

    Args:
        estimate: Model of the robot.
        loops: One per joint.
        tuning: Correction from a reference run.

    Raises:
        ConfigError: Model or loops belong to other joints.
    """
    ordered = in_order(samples.joint_names, estimate.robot.joint_names, loops)
    samples = samples.whole()
    torque = predict(estimate, samples.position, samples.velocity, samples.acceleration)
    return with_feedforward(samples, estimate.robot, ordered, torque, tuning)


def with_feedforward(
    samples: MotionSamples,
    robot: RobotDescription,
    loops: Sequence[VelocityLoop],
    torque_nm: FloatArray,
    tuning: FeedforwardTuning | None = None,
) -> MotionSamples:
    """Return the motion with the feedforward for its torque.

    With a coupled wrist, loops, torques and corrections are those of the motors. The feedforward is
    that of the joints, as the driver of the drives needs it (5.18).

    Args:
        robot: Robot of the motors.
        loops: One per joint, in the order of the joints.
        torque_nm: Shape (samples, n). Motor torques, link side [N m or N].
        tuning: Correction from a reference run.
    """
    coupling = WristCoupling.of_robot(robot)
    velocity, step_s = samples.velocity, samples.sample_period_s
    if coupling is not None:
        velocity = coupling.to_motors(velocity)
    ahead = rest_to_rest_feedforward(loops, velocity, torque_nm, step_s, tuning=tuning)
    if coupling is not None:
        ahead = ahead @ coupling.joints_by_motors.T
    rows = samples.samples_per_period
    if rows is None:
        return replace(samples, feedforward=ahead)
    last = turning_rows(samples)[1]
    period = slice(last - rows, last)
    own = periodic_feedforward(loops, velocity[period], torque_nm[period], step_s, tuning=tuning)
    if coupling is not None:
        own = own @ coupling.joints_by_motors.T
    return replace(samples, feedforward=with_period(samples, ahead, own))


def turning_rows(samples: MotionSamples) -> tuple[int, int]:
    """Return the first row of the first period of a periodic motion, and the end of its last."""
    turning = np.flatnonzero((samples.phase == Phase.MAIN) | (samples.phase == Phase.TRANSIENT))
    return int(turning[0]), int(turning[-1]) + 1


def with_period(samples: MotionSamples, rows: FloatArray, period: FloatArray) -> FloatArray:
    """Return rows of a motion that blend into the rows of its last period, and out again.

    Args:
        samples: A periodic motion.
        rows: Shape (samples, n). Values before and after the periods.
        period: Shape (samples_per_period, n). Values of the last period; all periods are equal.
    """
    first, last = turning_rows(samples)
    number = np.arange(len(samples))
    # Row k of the motion is row (k - last) of the period.
    exact = period[(number - last) % len(period)]
    over = max(1, round(BLEND_S / samples.sample_period_s))
    x = np.clip(np.minimum(number - first, last + over - number) / over, 0.0, 1.0)
    weight = (x * x * (3.0 - 2.0 * x))[:, np.newaxis]
    return np.asarray(rows + weight * (exact - rows))


def refuse_torque(
    motion: AnyMotion, samples: MotionSamples, estimate: Estimate, robot: RobotDescription
) -> None:
    """Refuse a motion that exceeds a joint's torque limit, cold or warm (`limit_torque`).

    Args:
        motion: The motion file.
        samples: The motion as planned.
        estimate: Model that predicts the torque.
        robot: Robot with the limits.

    Raises:
        LimitError: The limit is exceeded; the message names joint, time and, for a path, the
            segment.
    """
    samples = samples.whole()
    moved = (samples.position, samples.velocity, samples.acceleration)
    torque = np.abs(limit_torque(estimate, *moved))
    for j, joint in enumerate(robot.joints):
        row = int(torque[:, j].argmax())
        if torque[row, j] <= joint.limits.torque:
            continue
        unit = "N m" if joint.type == "revolute" else "N"
        where = f"at {row * samples.sample_period_s:.4g} s"
        place = motion.where(robot, samples.sample_period_s, row)
        if place:
            where += f", {place},"
        raise LimitError(
            f"{where} the motion needs {torque[row, j]:.4g} {unit} in joint {joint.name!r} by the"
            f" model; its limit is {joint.limits.torque:g}: drive it more slowly",
            code="RID-MOTION-LIMIT",
        )
