"""Torque and velocity feedforward of a motion, computed with a model of the robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from acquisition.motion.motion_file import AnyMotion
from acquisition.motion.samples import MotionSamples
from compensation.feedforward.inverse import (
    FeedforwardTuning,
    periodic_feedforward,
    rest_to_rest_feedforward,
)
from compensation.feedforward.motor_reference import MotorReference
from compensation.feedforward.periodic_rows import period_rows, with_period
from compensation.loops.velocity_loop import VelocityLoop, in_order
from compensation.ramped_load import RampedLoad, evaluate_over, row_times
from config.arrays import FloatArray
from config.errors import LimitError
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import convert_to_joints, convert_to_motors
from identification.elasticity.gear_torque import motor_torque
from identification.elasticity.limit_torque import limit_torque
from identification.estimation.estimate import Estimate


def compensated_motion(
    samples: MotionSamples,
    estimate: Estimate | RampedLoad,
    loops: Sequence[VelocityLoop],
    tuning: FeedforwardTuning | None = None,
    reference: MotorReference | None = None,
) -> MotionSamples:
    """Return the motion with its precompensated feedforward.

    The feedforward is computed in the frequency domain. For this purpose, a return to the start is
    appended, and the whole is treated as one long period. In a periodic motion, one period is also
    computed separately, so that the feedforward of all periods is equal.

    Args:
        estimate: Model of the robot. If its load changes, the motion must have no periods.
        loops: Velocity loops, one per joint.
        tuning: Correction of the feedforward, found in a reference run.
        reference: Motion of the motors of elastic gears, which is then returned instead of the
            planned motion; None for rigid gears.

    Raises:
        ConfigError: Model or loops belong to other joints.
    """
    ordered = in_order(samples.joint_names, estimate.robot.joint_names, loops)
    if reference is not None:
        robot, motors = estimate.robot, reference.samples
        return with_feedforward(motors, robot, ordered, reference.torque_nm, tuning)
    samples = samples.whole()
    moved = (samples.position, samples.velocity, samples.acceleration, samples.sample_period_s)
    torque = evaluate_over(estimate, row_times(samples), lambda model: motor_torque(model, *moved))
    return with_feedforward(samples, estimate.robot, ordered, torque, tuning)


def with_feedforward(
    samples: MotionSamples,
    robot: RobotDescription,
    loops: Sequence[VelocityLoop],
    torque_nm: FloatArray,
    tuning: FeedforwardTuning | None = None,
) -> MotionSamples:
    """Return the motion with the feedforward that generates its torque.

    With a coupled wrist, the loops, torques and corrections belong to the motors. The returned
    feedforward belongs to the joints, because the driver of the drives expects joint speeds (5.18).

    Args:
        robot: The robot, with its wrist coupling if it has one.
        loops: Velocity loops, one per joint, in the order of the joints.
        torque_nm: Shape (samples, n). Motor torques, link side [N m or N].
        tuning: Correction of the feedforward, found in a reference run.
    """
    velocity, step_s = convert_to_motors(robot, samples.velocity), samples.sample_period_s
    ahead = rest_to_rest_feedforward(loops, velocity, torque_nm, step_s, tuning=tuning)
    if samples.samples_per_period is not None:
        period = period_rows(samples)
        rows = (velocity[period], torque_nm[period])
        own = periodic_feedforward(loops, *rows, step_s, tuning=tuning)
        ahead = with_period(samples, ahead, own)
    return replace(samples, feedforward=convert_to_joints(robot, ahead))


def refuse_torque(
    motion: AnyMotion,
    samples: MotionSamples,
    estimate: Estimate | RampedLoad,
    robot: RobotDescription,
) -> None:
    """Refuse a motion that exceeds a torque limit with cold or warm joints (`limit_torque`).

    Args:
        motion: The motion file.
        samples: The motion of the motors.
        estimate: Model that predicts the torque.
        robot: Robot with the limits.

    Raises:
        LimitError: The limit is exceeded; the message names joint, time and, for a path, the
            segment.
    """
    samples = samples.whole()
    moved = (samples.position, samples.velocity, samples.acceleration, samples.sample_period_s)
    times_s = row_times(samples)
    torque = np.abs(evaluate_over(estimate, times_s, lambda model: limit_torque(model, *moved)))
    for j, joint in enumerate(robot.joints):
        row = int(torque[:, j].argmax())
        if torque[row, j] <= joint.limits.torque:
            continue
        unit = joint.torque_unit
        where = f"at {row * samples.sample_period_s:.4g} s"
        place = motion.where(robot, samples.sample_period_s, row)
        if place:
            where += f", {place},"
        raise LimitError(
            f"{where} the motion needs {torque[row, j]:.4g} {unit} in joint {joint.name!r}"
            f" according to the model; the limit is {joint.limits.torque:g} {unit}: drive it more"
            " slowly",
            code="RID-MOTION-LIMIT",
        )
