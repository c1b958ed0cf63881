"""A motion with the feedforward that a model and the velocity loops give it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from acquisition.motion_samples import MotionSamples
from compensation.feedforward import (
    FeedforwardTuning,
    periodic_feedforward,
    rest_to_rest_feedforward,
)
from compensation.online import in_order
from compensation.period_blend import turning_rows, with_period
from compensation.velocity_loop import VelocityLoop
from identification.estimate import Estimate, predict


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
    step_s = samples.sample_period_s
    ahead = rest_to_rest_feedforward(ordered, samples.velocity, torque, step_s, tuning=tuning)
    rows = samples.samples_per_period
    if rows is None:
        return replace(samples, feedforward=ahead)
    last = turning_rows(samples)[1]
    period = slice(last - rows, last)
    own = periodic_feedforward(
        ordered, samples.velocity[period], torque[period], step_s, tuning=tuning
    )
    return replace(samples, feedforward=with_period(samples, ahead, own))
