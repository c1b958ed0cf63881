"""Derivatives of the inverse dynamics, exact to rounding, and the joint-space inertia.

All are taken by the complex step (Squire and Trapp 1998): f(x + i h) = f(x) + i h f'(x) + O(h^2),
so with h = 1e-30 the imaginary part over h is the derivative without any difference being taken.
The regressor's kernels and terms accept complex motions, so each effect is written down once only.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt

from config.errors import EstimationError
from dynamics.conditions import Conditions
from dynamics.kinematics import FloatArray
from dynamics.robot_model import RobotModel, load_torque, regressor

STEP: Final = 1e-30

ComplexArray = npt.NDArray[np.complex128]


def torque_derivatives(
    model: RobotModel,
    q: npt.ArrayLike,
    v: npt.ArrayLike,
    a: npt.ArrayLike,
    parameters: npt.ArrayLike,
    conditions: Conditions | None = None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the derivatives of the actuators' torques by q, v and a.

    Parameters
    ----------
    model : RobotModel
        The robot. The derivative of a hard sign(v) is 0; smooth it to see the jump.
    q, v, a : (samples, n) arrays
        Joint positions, velocities, accelerations [rad or m, per s, per s^2].
    parameters : (parameters,) array
        Values of `model.parameter_names`.
    conditions : Conditions, optional
        Temperature and payload.

    Returns
    -------
    by_q, by_v, by_a : (samples, n, n) arrays
        Element (s, i, j) is the derivative of torque i by coordinate j; `by_a` is the joint-space
        inertia, rows in actuator coordinates.

    Raises
    ------
    EstimationError
        Where a shape does not fit the model.
    """
    theta = np.asarray(parameters, dtype=np.float64)
    if model.transmission.losses:
        load = load_torque(model, q, v, a, theta, conditions)
        conditions = replace(conditions or Conditions(), load_nm=load)

    def torques(motion: ComplexArray) -> ComplexArray:
        return _complex_regressor(model, motion, conditions) @ theta

    steps = list(_steps(torques, q, v, a))
    n = model.chain.n
    by_q, by_v, by_a = (np.stack(steps[k * n : (k + 1) * n], axis=-1) for k in range(3))
    return by_q, by_v, by_a


def mass_matrix(model: RobotModel, q: npt.ArrayLike, parameters: npt.ArrayLike) -> FloatArray:
    """Return the joint-space inertia with rotors and armatures, (samples, n, n).

    Parameters
    ----------
    model : RobotModel
        The robot.
    q : (samples, n) array
        Joint positions [rad or m].
    parameters : (parameters,) array
        Values of `model.parameter_names`.

    Raises
    ------
    EstimationError
        Where a shape does not fit the model.
    """
    position = np.asarray(q, dtype=np.float64)
    rest = np.zeros_like(position)
    lossless = replace(model, transmission=type(model.transmission)())
    inertia = torque_derivatives(lossless, position, rest, rest, parameters)[2]
    if model.coupling is not None:
        inertia = np.einsum("ji,sjk->sik", np.linalg.inv(model.coupling), inertia)
    return inertia


def regressor_gradient(
    model: RobotModel,
    q: npt.ArrayLike,
    v: npt.ArrayLike,
    a: npt.ArrayLike,
    weights: FloatArray,
    conditions: Conditions | None = None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return how the sum of weights * Phi changes with the motion.

    Any scalar J of the regressor has the gradient that this gives with weights = dJ / dPhi.

    Parameters
    ----------
    model : RobotModel
        The robot.
    q, v, a : (samples, n) arrays
        Joint positions, velocities, accelerations [rad or m, per s, per s^2].
    weights : (samples, n, parameters) array
        The weights.
    conditions : Conditions, optional
        As for `regressor`.

    Returns
    -------
    by_q, by_v, by_a : (samples, n) arrays
        The gradient.

    Raises
    ------
    EstimationError
        Where a shape does not fit the model.
    """
    expected = (*np.shape(q), len(model.parameter_names))
    if weights.shape != expected:
        raise EstimationError(f"weights must have the shape {expected}, got {weights.shape}")

    def weighed(motion: ComplexArray) -> ComplexArray:
        phi = _complex_regressor(model, motion, conditions)
        return np.asarray(np.sum(weights * phi, axis=(1, 2)))

    steps = list(_steps(weighed, q, v, a))
    n = model.chain.n
    by_q, by_v, by_a = (np.stack(steps[k * n : (k + 1) * n], axis=-1) for k in range(3))
    return by_q, by_v, by_a


def _complex_regressor(
    model: RobotModel, motion: ComplexArray, conditions: Conditions | None
) -> ComplexArray:
    q, v, a = motion
    return np.asarray(regressor(model, q, v, a, conditions), np.complex128)


def _steps(
    function: Callable[[ComplexArray], ComplexArray],
    *motion: npt.ArrayLike,
) -> Iterator[FloatArray]:
    """Yield the derivative of a function of q, v, a by each column of q, then of v, then of a."""
    point = np.array(motion, dtype=np.complex128)
    for kind in range(len(point)):
        for joint in range(point.shape[2]):
            point[kind, :, joint] += 1j * STEP
            yield np.asarray(function(point).imag / STEP)
            point[kind, :, joint] -= 1j * STEP
