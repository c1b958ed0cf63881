"""Derivatives of torque and regressor by the motion, and the joint-space inertia matrix.

The derivatives are not finite differences. Those of links, payload and rotors are computed by
reverse-mode differentiation (Griewank and Walther 2008), those of friction and springs by the
complex step.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from config.arrays import FloatArray
from config.errors import EstimationError
from dynamics.model.robot_model import RobotModel, checked_parameters, load_torque
from dynamics.model.transmission import Transmission
from dynamics.terms.conditions import Conditions


def torque_derivatives(
    model: RobotModel,
    q: npt.ArrayLike,
    v: npt.ArrayLike,
    a: npt.ArrayLike,
    parameters: npt.ArrayLike,
    conditions: Conditions | None = None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the derivatives of the actuators' torques by q, v and a.

    Args:
        model: The robot. The jumps of a discontinuous sign(v) and of gear losses are not
            differentiated, and the direction of the presliding hysteresis counts as constant.
        q, v, a: Shape (samples, n). Joint positions, velocities, accelerations [rad or m, per s,
            per s^2].
        parameters: Shape (parameters,). Values of `model.parameter_names`.
        conditions: Temperature, payload and presliding hysteresis; `load_nm` is computed here.

    Returns:
        `by_q, by_v, by_a`, shape (samples, n, n). Element (s, i, j) is the derivative of actuator
        torque i in sample s by q, v or a of joint j.

    Raises:
        EstimationError: A shape does not fit the model, or a condition is missing.
    """
    theta = checked_parameters(model, parameters)
    if model.transmission.losses:
        load = load_torque(model, q, v, a, theta, conditions)
        conditions = replace(conditions or Conditions(), load_nm=load)
    motion = model.motion(q, v, a, conditions)
    _, samples, n = motion.joint.shape
    factors = model.transmission.factors(motion)
    out = np.zeros((n, 3, samples, n))
    for term, columns in zip(model.terms, model.parameter_groups.values(), strict=True):
        # With these weights, sum number i is the torque of actuator i.
        one_row = np.eye(n)[:, np.newaxis, :, np.newaxis] * theta[columns]
        weights = np.broadcast_to(one_row, (n, samples, *one_row.shape[2:]))
        by_motion = term.torque_gradient(motion, weights)
        if factors is not None and term.through_gears:
            by_motion *= factors.T[:, np.newaxis, :, np.newaxis]
        out += by_motion
    by_q, by_v, by_a = np.ascontiguousarray(out.transpose(1, 2, 0, 3))
    return by_q, by_v, by_a


def mass_matrix(model: RobotModel, q: npt.ArrayLike, parameters: npt.ArrayLike) -> FloatArray:
    """Return the joint-space inertia matrix with rotors and armatures, (samples, n, n).

    Its rows belong to joint torques (not actuator torques), without gear losses.

    Args:
        model: The robot; a payload is not included.
        q: Shape (samples, n). Joint positions [rad or m].
        parameters: Shape (parameters,). Values of `model.parameter_names`.

    Raises:
        EstimationError: A shape does not fit the model.
    """
    theta = checked_parameters(model, parameters)
    inertial = replace(
        model,
        terms=tuple(term for term in model.terms if term.inertial),
        transmission=Transmission(),
    )
    groups = model.parameter_groups
    kept = np.concatenate([theta[groups[term.name]] for term in inertial.terms])
    rest = np.zeros_like(np.asarray(q, dtype=np.float64))
    inertia = torque_derivatives(inertial, q, rest, rest, kept)[2]
    if model.coupling is not None:
        inertia = np.einsum("ij,sik->sjk", model.coupling.motors_by_joints, inertia)
    return inertia


def regressor_gradient(
    model: RobotModel,
    q: npt.ArrayLike,
    v: npt.ArrayLike,
    a: npt.ArrayLike,
    weights: FloatArray,
    conditions: Conditions | None = None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the gradient of sum(weights * Phi) by q, v and a; Phi is the regressor.

    With weights = dJ / dPhi, the result is the gradient of a scalar J(Phi).

    Args:
        model: The robot. The jumps of a discontinuous sign(v) and of gear losses are not
            differentiated, and the direction of the presliding hysteresis counts as constant.
        q, v, a: Shape (samples, n). Joint positions, velocities, accelerations [rad or m, per s,
            per s^2].
        weights: Shape (samples, n, parameters). Weight of each element of the regressor.
        conditions: As for `regressor`.

    Returns:
        `by_q, by_v, by_a`, shape (samples, n). The gradient by q, v and a of the joints.

    Raises:
        EstimationError: A shape does not fit the model, or a condition is missing.
    """
    motion = model.motion(q, v, a, conditions)
    expected = (*motion.joint.shape[1:], len(model.parameter_names))
    if weights.shape != expected:
        raise EstimationError(
            f"weights must have the shape {expected}, got {weights.shape}", code="RID-API-ARGUMENT"
        )
    factors = model.transmission.factors(motion)
    out = np.zeros(motion.joint.shape)
    for term, columns in zip(model.terms, model.parameter_groups.values(), strict=True):
        on_term = weights[np.newaxis, :, :, columns]
        if factors is not None and term.through_gears:
            on_term = on_term * factors[:, :, np.newaxis]
        out += term.torque_gradient(motion, on_term)[0]
    by_q, by_v, by_a = out
    return by_q, by_v, by_a
