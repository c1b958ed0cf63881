"""Derivatives of the torque by the nonlinear parameters."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from config.arrays import FloatArray
from dynamics.model.memory import presliding_of_model
from dynamics.model.robot_model import RobotModel, checked_parameters
from dynamics.terms.conditions import Conditions
from dynamics.terms.term import NonlinearTerm


def nonlinear_slopes(
    model: RobotModel,
    q: npt.ArrayLike,
    v: npt.ArrayLike,
    a: npt.ArrayLike,
    parameters: npt.ArrayLike,
    conditions: Conditions | None = None,
) -> FloatArray:
    """Return the derivatives of the torque with respect to the nonlinear parameters.

    Args:
        model: The robot.
        q, v, a: Shape (samples, n). Joint positions, velocities, accelerations [rad or m, per s,
            per s^2].
        parameters: Shape (parameters,). Values of `model.parameter_names`.
        conditions: Conditions of the motion; `load_nm` is required if gears have losses.

    Returns:
        Shape (samples, n, nonlinear parameters), in the order of `model.nonlinear_names`.

    Raises:
        EstimationError: A shape does not fit the model, or a condition is missing.
    """
    theta = checked_parameters(model, parameters)
    motion = model.motion(q, v, a, conditions)
    parts = [
        term.nonlinear_slopes(motion, theta[columns])
        for term, columns in zip(model.terms, model.parameter_groups.values(), strict=True)
        if isinstance(term, NonlinearTerm)
    ]
    slopes = np.concatenate([*parts, model.transmission.nonlinear_slopes(motion)], axis=2)
    memory = motion.conditions.memory
    if memory is not None and model.transmission.losses:
        by_direction = model.transmission.memory_slopes(motion)
        for own in presliding_of_model(model):
            for parameter, steepness in memory.slopes(own):
                place = model.nonlinear_names.index(parameter.name)
                slopes[:, own.joint, place] += by_direction[:, own.joint] * steepness
    return slopes
