"""A motion with the feedforward that a model and the velocity loops give it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from acquisition.arrays import FloatArray
from acquisition.motion_samples import MotionSamples, Phase
from compensation.feedforward import FeedforwardTuning, feedforward, periodic_feedforward
from compensation.online import in_order
from compensation.velocity_loop import VelocityLoop
from identification.estimate import Estimate, predict

BLEND_S = 0.3


def compensated_motion(
    samples: MotionSamples,
    estimate: Estimate,
    loops: Sequence[VelocityLoop],
    tuning: FeedforwardTuning | None = None,
) -> MotionSamples:
    """Return the motion with its pre-compensated feedforward.

    Periods are compensated exactly, on their bins; what leads into them and out of them, and
    motions that are not periodic, in time, and the two are blended.

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
    ahead = feedforward(ordered, samples.velocity, torque, step_s, tuning=tuning)
    rows = samples.samples_per_period
    if rows is None:
        return replace(samples, feedforward=ahead)
    turning = np.flatnonzero((samples.phase == Phase.MAIN) | (samples.phase == Phase.TRANSIENT))
    first, last = int(turning[0]), int(turning[-1]) + 1
    period = slice(last - rows, last)
    own = periodic_feedforward(
        ordered, samples.velocity[period], torque[period], step_s, tuning=tuning
    )
    # The motion's row k is row (k - last) of the period, everywhere.
    exact = own[(np.arange(len(ahead)) - last) % rows]
    weight = _blend(len(ahead), first, last, max(1, round(BLEND_S / step_s)))
    return replace(samples, feedforward=ahead + weight[:, np.newaxis] * (exact - ahead))


def _blend(samples: int, first: int, last: int, over: int) -> FloatArray:
    """Return a weight that rises from `first` on, is 1, and falls from `last` on."""
    rows = np.arange(samples)
    x = np.clip(np.minimum(rows - first, last + over - rows) / over, 0.0, 1.0)
    return np.asarray(x * x * (3.0 - 2.0 * x))
