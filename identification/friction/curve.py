"""`FrictionCurve`: friction of one joint as a function of speed, measured separately.

The friction torque has two parts:
- `odd` changes its sign with the direction. It can be measured without knowledge of gravity.
- `even` does not change its sign: friction is larger in one direction. Its measurement needs known
  or modelled gravity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from config.arrays import FloatArray, freeze
from config.errors import EstimationError
from dynamics.model.robot_model import RobotModel
from dynamics.terms.conditions import Conditions
from dynamics.terms.friction import Friction


@dataclass(frozen=True, eq=False)
class FrictionCurve:
    """Friction at k speeds, link side.

    The friction torque is odd + even when moving forwards at `speed`, and -odd + even backwards.

    Attributes:
        speed: Shape (k,). Speeds, positive [rad/s or m/s].
        odd, odd_sigma: Shape (k,). Half of the torque difference between both directions, and its
            standard deviation [N m or N].
        even: Shape (k,). Half of the torque sum of both directions, without gravity [N m or N];
            None if it was not measured.
        even_covariance: Shape (k, k). Covariance of `even`: the error of gravity is common to all
            speeds.
    """

    joint: str
    speed: FloatArray
    odd: FloatArray
    odd_sigma: FloatArray
    even: FloatArray | None = None
    even_covariance: FloatArray | None = None

    def __post_init__(self) -> None:
        k = len(self.speed)
        if (self.even is None) != (self.even_covariance is None):
            raise EstimationError(
                "friction curve: give `even` and `even_covariance` together, or neither",
                code="RID-API-ARGUMENT",
            )
        of_speeds = ("speed", "odd", "odd_sigma", "even")
        freeze(self, EstimationError, (k,), *of_speeds, what="friction ")
        freeze(self, EstimationError, (k, k), "even_covariance", what="friction ")

    @property
    def forward(self) -> FloatArray | None:
        """Friction torque when moving forwards, shape (k,) [N m or N]."""
        return None if self.even is None else self.odd + self.even

    @property
    def backward(self) -> FloatArray | None:
        """Friction torque when moving backwards, usually negative, shape (k,) [N m or N]."""
        return None if self.even is None else self.even - self.odd

    @property
    def direction_sigma(self) -> FloatArray | None:
        """Standard deviation of `forward` and of `backward`, shape (k,)."""
        if self.even_covariance is None:
            return None
        return np.asarray(np.sqrt(self.odd_sigma**2 + np.diagonal(self.even_covariance)))


def join_curves(curves: Sequence[FrictionCurve]) -> FrictionCurve:
    """Join the curves of one joint, ordered by speed.

    The result has `even` only if all curves have it.
    """
    speed = np.concatenate([curve.speed for curve in curves])
    order = np.argsort(speed, kind="stable")
    evens = [curve.even for curve in curves if curve.even is not None]
    covariances = [c.even_covariance for c in curves if c.even_covariance is not None]
    even = covariance = None
    if len(evens) == len(curves):
        even = np.concatenate(evens)[order]
        covariance = np.zeros((len(speed), len(speed)))
        start = 0
        for block in covariances:
            covariance[start : start + len(block), start : start + len(block)] = block
            start += len(block)
        covariance = covariance[order[:, np.newaxis], order]
    return FrictionCurve(
        joint=curves[0].joint,
        speed=speed[order],
        odd=np.concatenate([curve.odd for curve in curves])[order],
        odd_sigma=np.concatenate([curve.odd_sigma for curve in curves])[order],
        even=even,
        even_covariance=covariance,
    )


def friction_columns(model: RobotModel, joint: int, speed: FloatArray) -> FloatArray:
    """Return the friction torque per unit of each friction coefficient, for one joint.

    Args:
        model: The robot, with friction.
        joint: The joint's index, from 0; the other joints are at rest.
        speed: Shape (s,). Signed speeds of the joint's actuator [rad/s or m/s].

    Returns:
        Shape (s, coefficients). N m or N per unit, at the reference temperatures.

    Raises:
        EstimationError: The model has no friction.
    """
    term = next((term for term in model.terms if isinstance(term, Friction)), None)
    if term is None:
        raise EstimationError(
            "the model has no friction terms: add friction to the robot's joints",
            code="RID-MODEL-NO-FRICTION",
        )
    n = model.chain.n
    velocity = np.zeros((len(speed), n))
    velocity[:, joint] = speed
    if model.coupling is not None:
        velocity = velocity @ model.coupling.joints_by_motors.T
    rest, warm = np.zeros_like(velocity), np.full(n, np.nan)
    for column in term.columns:
        warm[column.joint] = column.reference_temperature_k
    motion = model.motion(rest, velocity, rest, Conditions(temperature_k=warm))
    out = np.zeros((len(speed), n, len(term.columns)))
    term.fill_torque(motion, out)
    return out[:, joint]
