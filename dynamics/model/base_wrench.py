"""The base wrench for given parameters, and the gradient of its weighted sum by the motion."""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import FloatArray
from dynamics.model.robot_model import RobotModel, base_wrench_regressor, checked_parameters

STEP: Final = 1e-4


def base_wrench(
    model: RobotModel, q: FloatArray, v: FloatArray, a: FloatArray, parameters: FloatArray
) -> FloatArray:
    """Return the wrench that the base exerts on the robot, (samples, 6) [N, N m].

    Args:
        model: The robot.
        q, v, a: Shape (samples, n). Joint positions, velocities, accelerations [rad or m, per s,
            per s^2].
        parameters: Shape (parameters,). Values of `model.parameter_names`.

    Raises:
        EstimationError: A shape does not fit the model.
    """
    theta = checked_parameters(model, parameters)
    return np.asarray(base_wrench_regressor(model, q, v, a) @ theta)


def base_wrench_gradient(
    model: RobotModel,
    q: FloatArray,
    v: FloatArray,
    a: FloatArray,
    parameters: FloatArray,
    weights: FloatArray,
) -> FloatArray:
    """Return the gradient of sum(weights * base wrench) by q, v and a, (3, samples, n).

    The gradient is computed by central differences. Except for rounding errors, they are exact for
    v, because the wrench is quadratic in v, and for a, because it is linear in a. For q the
    relative error is about 1e-8.

    Args:
        model, q, v, a, parameters: As for `base_wrench`.
        weights: Shape (samples, 6). Weight of each component of the wrench in each sample.
    """
    motion = np.array([q, v, a])
    _, samples, n = motion.shape
    steps = np.zeros((3, n, 3, 1, n))
    for order in range(3):
        steps[order, range(n), order, 0, range(n)] = STEP
    moved = np.stack([motion + steps, motion - steps])  # (2, 3, n, 3, samples, n)
    flat = moved.transpose(3, 0, 1, 2, 4, 5).reshape(3, -1, n)
    wrench = base_wrench(model, flat[0], flat[1], flat[2], parameters).reshape(2, 3, n, samples, 6)
    slopes = (wrench[0] - wrench[1]) / (2.0 * STEP)
    return np.asarray(np.einsum("djsk,sk->dsj", slopes, weights))
