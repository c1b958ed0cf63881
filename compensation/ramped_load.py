"""`RampedLoad`: model of a robot whose payload changes during a motion.

While the load is transferred, the parameters are a blend of those before and after,

    theta(t) = (1 - w) theta_before + w theta_after ,

in which w grows linearly from 0 to 1. Only the load depends on time; the robot is the same.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from acquisition.motion.samples import MotionSamples
from config.arrays import FloatArray, freeze
from config.errors import ConfigError
from config.robot.robot import RobotDescription
from identification.estimation.estimate import Estimate


@dataclass(frozen=True, eq=False)
class RampedLoad:
    """Models of a robot with each of its loads, and the times of the changes.

    Attributes:
        estimates: The robot with its first load, and after each change; all have the same base
            parameters.
        begin_s: Shape (changes,). Beginning of each change, from the first row of the motion [s].
        ramp_s: Shape (changes,). Duration of each change [s].
    """

    estimates: tuple[Estimate, ...]
    begin_s: FloatArray
    ramp_s: FloatArray

    def __post_init__(self) -> None:
        freeze(self, ConfigError, (len(self.estimates) - 1,), "begin_s", "ramp_s")
        first = self.estimates[0].base
        for other in self.estimates[1:]:
            assert other.base.expressions == first.expressions

    @property
    def robot(self) -> RobotDescription:
        """The robot."""
        return self.estimates[0].robot

    def weights(self, time_s: FloatArray) -> FloatArray:
        """Return the weight of each load, (rows, loads), at times of shape (rows,); sum 1."""
        risen = np.clip((time_s[:, np.newaxis] - self.begin_s) / self.ramp_s, 0.0, 1.0)
        # a signal may come late: the next change then begins before this one is complete
        risen = np.minimum.accumulate(risen, axis=1)
        ones, zeros = np.ones((len(time_s), 1)), np.zeros((len(time_s), 1))
        return np.asarray(np.hstack([ones, risen]) - np.hstack([risen, zeros]))

    def blended(self, weights: FloatArray) -> Estimate:
        """Return the model with the parameters of a blend; weights have the shape (loads,)."""
        values = np.array([estimate.values for estimate in self.estimates])
        return replace(self.estimates[0], values=weights @ values)


def evaluate_over(
    load: Estimate | RampedLoad, time_s: FloatArray, torque: Callable[[Estimate], FloatArray]
) -> FloatArray:
    """Return the torques of a motion, in each row with the load at its time.

    Args:
        load: The model; one `Estimate` if the load does not change.
        time_s: Shape (rows,). Time of each row, from the first row of the motion [s].
        torque: Function that returns the torques of all rows, (rows, n), by a model.
    """
    if isinstance(load, Estimate):
        return torque(load)
    weights = load.weights(time_s)
    every = np.array([torque(one) for one in load.estimates])
    found = np.asarray(np.einsum("rk,krn->rn", weights, every))
    if load.estimates[0].model.transmission.losses:
        # The torque of a lossy gear is not linear in the parameters: its losses follow the sign of
        # the transmitted power.
        for row in np.flatnonzero((weights > 0.0).sum(axis=1) > 1):
            found[row] = torque(load.blended(weights[row]))[row]
    return found


def row_times(samples: MotionSamples) -> FloatArray:
    """Return the time of each row of a motion, (rows,) [s]."""
    return np.asarray(np.arange(len(samples)) * samples.sample_period_s)


def without_periods(samples: MotionSamples) -> MotionSamples:
    """Return a motion with all its rows; its periods, in which the load differs, are not used."""
    return replace(samples.whole(), samples_per_period=None, periods=0)
