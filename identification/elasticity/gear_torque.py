"""`motor_torque`, `gear_torque`: torques that the motors of elastic gears need for their motion.

Encoders at the motors measure theta, but the links are at q = theta - tau_link / (k + s d), in
which s is the Laplace variable. Rigid gears would need the torque of the links for theta. The
motors of elastic gears need it for q: tau_link(theta) - tau_link(q) less. The deflection is
computed up to half the lowest resonance of a link on a locked motor.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from acquisition.processing.periods import PeriodAverage
from acquisition.processing.smoothing import low_pass
from acquisition.signals.bins import differentiate_on_bins, filter_response, from_bins, to_bins
from acquisition.signals.splines import quintic_derivatives
from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import convert_to_joints
from dynamics.terms.conditions import Conditions
from identification.elasticity.transmitted_torque import transmitted_torque
from identification.estimation.estimate import BLOCK_ROWS, Estimate, predict
from identification.model.inertia import inertia_size

STEPS: Final = 20
SETTLED_RAD: Final = 1e-9
DIVERGED_RAD: Final = 10.0
SHARE_OF_RESONANCE: Final = 0.5
"""Highest frequency of the deflection over the lowest resonance of a link on a locked motor; near
the resonance, errors of the stiffness are magnified."""


def has_stiffness(robot: RobotDescription) -> bool:
    """Return True if the stiffness of at least one gear is known."""
    return any(joint.stiffness_nm_rad is not None for joint in robot.joints)


def describe_gear_torque(robot: RobotDescription, torque_nm: FloatArray) -> str:
    """Return a phrase with the torque that deflection changes, such as "axis1 0.2 N m (RMS)".

    Args:
        torque_nm: Shape (n,). RMS of the torque of each joint [N m or N].
    """
    each = [
        f"{joint.name} {value:.2g} {joint.torque_unit}"
        for joint, value in zip(robot.joints, torque_nm.tolist(), strict=True)
    ]
    return f"{', '.join(each)} (RMS)"


def motor_torque(
    estimate: Estimate,
    position: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    step_s: float,
    conditions: Conditions | None = None,
) -> FloatArray:
    """Return the torques of a motion of the motors, shape (samples, n) [N m or N].

    They are the predicted torques, for a model of the links behind elastic gears less
    `gear_torque`.

    Args:
        estimate: The model.
        position, velocity, acceleration: Shape (samples, n). Uniform samples of the motion, without
            gaps [rad or m, per second, per second squared].
        step_s: Time between rows [s].
        conditions: As in `predict`.

    Raises:
        EstimationError: The deflection does not converge.
    """
    torque = predict(estimate, position, velocity, acceleration, conditions)
    if estimate.gear_torque_nm is None:
        return torque
    return torque - gear_torque(estimate, position, step_s)


def gear_torque(
    estimate: Estimate, position: FloatArray, step_s: float, *, payload: bool = False
) -> FloatArray:
    """Return how much more torque rigid gears would need for a motion of the motors.

    Args:
        estimate: Model of the links; its robot states the stiffness of at least one gear.
        position: Shape (samples, n). Positions of the motors without gaps [rad or m].
        step_s: Time between rows [s].
        payload: True if the robot carries the payload whose parameters are in the estimate.

    Returns:
        Shape (samples, n) [N m or N], in the order of the motors.

    Raises:
        EstimationError: The deflection does not converge.
    """
    stiffness, damping = _gears(estimate.robot)
    band_hz = _band_hz(estimate, position, step_s)

    def derivatives(q: FloatArray) -> Sequence[FloatArray]:
        return quintic_derivatives(q, step_s)

    def deflection(torque: FloatArray, before: FloatArray) -> FloatArray:
        spring = torque - damping * derivatives(before)[0]
        return low_pass(spring / stiffness, step_s, band_hz)

    theta = low_pass(position, step_s, band_hz)
    return _torque_difference(estimate, theta, derivatives, deflection, payload)


def with_rigid_gears(
    average: PeriodAverage, estimate: Estimate, *, payload: bool = False
) -> PeriodAverage:
    """Return a mean period with the torques that rigid gears would need for the motors' motion.

    Args:
        average: The measured mean period. It is returned unchanged if no stiffness is known.
        estimate: Model of the links; its robot states the stiffness.
        payload: True if the run carried the payload of the estimate.

    Raises:
        EstimationError: The deflection does not converge.
    """
    if not has_stiffness(estimate.robot):
        return average
    stiffness, damping = _gears(estimate.robot)
    step_s, rows = average.sample_period_s, len(average.position)
    band_hz = _band_hz(estimate, average.position, step_s)
    harmonics = max(1, math.floor(band_hz * average.period_s))
    frequency_hz = np.arange(harmonics + 1) / average.period_s
    gear = stiffness + 2j * math.pi * frequency_hz[:, np.newaxis] * damping

    def derivatives(q: FloatArray) -> Sequence[FloatArray]:
        return differentiate_on_bins(q, step_s, harmonics)[1:]

    def deflection(torque: FloatArray, _before: FloatArray) -> FloatArray:
        return from_bins(to_bins(torque, harmonics) / gear, rows)

    theta = from_bins(to_bins(average.position, harmonics), rows)
    torque = _torque_difference(estimate, theta, derivatives, deflection, payload)
    more = to_bins(torque, harmonics)
    if average.torque_filter is not None:
        more = more * filter_response(average.torque_filter, frequency_hz)[:, np.newaxis]
    return replace(average, torque_nm=average.torque_nm + from_bins(more, rows))


def _torque_difference(
    estimate: Estimate,
    theta: FloatArray,
    derivatives: Callable[[FloatArray], Sequence[FloatArray]],
    deflection: Callable[[FloatArray, FloatArray], FloatArray],
    payload: bool,
) -> FloatArray:
    """Return tau_link(theta) - tau_link(q), (samples, n), by a fixed point for the deflection.

    Args:
        theta: Shape (samples, n). Positions of the motors, low-passed.
        derivatives: Function for velocity and acceleration of a position.
        deflection: Function for the deflection, in the order of the motors, from the torques that
            the gears transmit and the deflection of the step before.
    """
    robot = estimate.robot

    def links_torque(bent: FloatArray) -> FloatArray:
        q = theta - convert_to_joints(robot, bent)
        motion = (q, *derivatives(q))
        torque = np.empty_like(q)
        for start in range(0, len(q), BLOCK_ROWS):
            rows = slice(start, start + BLOCK_ROWS)
            own = (each[rows] for each in motion)
            torque[rows] = transmitted_torque(estimate, robot, *own, payload=payload)
        return torque

    bent = np.zeros_like(theta)
    of_motors = torque = links_torque(bent)
    for _ in range(STEPS):
        step = deflection(torque, bent) - bent
        bent = bent + step
        if not np.abs(step).max() < DIVERGED_RAD:
            break
        torque = links_torque(bent)
        if np.abs(step).max() < SETTLED_RAD:
            return np.asarray(of_motors - torque)
    raise EstimationError(
        f"the deflection of the gears does not converge in {STEPS} steps: check the stiffness of"
        " the gears in the model's robot",
        code="RID-STIFFNESS-UNSETTLED",
    )


def _gears(robot: RobotDescription) -> tuple[FloatArray, FloatArray]:
    """Return stiffness [N m/rad or N/m] and damping of each gear; infinite and 0 if not known."""
    return (
        np.array([joint.stiffness_nm_rad or math.inf for joint in robot.joints]),
        np.array([joint.damping_nm_s or 0.0 for joint in robot.joints]),
    )


def _band_hz(estimate: Estimate, position: FloatArray, step_s: float) -> float:
    """Return the highest frequency of the deflection that is computed [Hz].

    Args:
        position: Shape (samples, n). Positions of the motion [rad or m].
    """
    inertia = np.diagonal(inertia_size(estimate.model, estimate.base, position, estimate.values))
    lowest_rad_s = float(np.min(np.sqrt(_gears(estimate.robot)[0] / inertia)))
    return min(SHARE_OF_RESONANCE * lowest_rad_s / (2.0 * math.pi), 0.4 / step_s)
