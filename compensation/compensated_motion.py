"""A motion with the feedforward that a model and the velocity loops give it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from acquisition.motion.samples import MotionSamples
from compensation.feedforward.inverse import (
    FeedforwardTuning,
    periodic_feedforward,
    rest_to_rest_feedforward,
)
from compensation.loops.velocity_loop import VelocityLoop
from compensation.online.online import in_order
from compensation.period_blend import turning_rows, with_period
from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import WristCoupling
from identification.estimation.estimate import Estimate, predict


def compensated_motion(
    samples: MotionSamples,
    estimate: Estimate,
    loops: Sequence[VelocityLoop],
    tuning: FeedforwardTuning | None = None,
) -> MotionSamples:
    """Return the motion with its pre-compensated feedforward.

    Everything is compensated on bins: periods on their own, so that all are alike, and the motion
    as a whole on those of one long period with a return to its start.

    Parameters
    ----------
    samples : MotionSamples
        The motion.
    estimate : Estimate
        The model of the robot.
    loops : sequence of VelocityLoop
        One a joint.
    tuning : FeedforwardTuning, optional
        Correction from a reference run.

    Raises
    ------
    ConfigError
        Model or loops are of other joints.
    """
    ordered = in_order(samples.joint_names, estimate.robot.joint_names, loops)
    torque = predict(estimate, samples.position, samples.velocity, samples.acceleration)
    return with_feedforward(samples, estimate.robot, ordered, torque, tuning)


def with_feedforward(
    samples: MotionSamples,
    robot: RobotDescription,
    loops: Sequence[VelocityLoop],
    torque_nm: FloatArray,
    tuning: FeedforwardTuning | None = None,
) -> MotionSamples:
    """Return the motion with the feedforward that its torque takes.

    With a coupled wrist, loops and torques are the motors', and so is what is corrected; the
    feedforward is the joints' again, as the drives' driver takes it (5.18).

    Parameters
    ----------
    samples : MotionSamples
        The motion.
    robot : RobotDescription
        Whose motors they are.
    loops : sequence of VelocityLoop
        One a joint, in the joints' order.
    torque_nm : ndarray, shape (samples, n)
        The motors' torques, link side [N m or N].
    tuning : FeedforwardTuning, optional
        Correction from a reference run.
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
