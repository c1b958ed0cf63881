"""`gear_torque`: the torque by which elastic gears change what the motors need for their motion.

Encoders at the motors measure theta, but the links are at q = theta - tau_link / (k + s d). Rigid
gears would need the torque of the links for theta. The motors of elastic gears need it for q:
tau_link(theta) - tau_link(q) less. The deflection is computed up to half the lowest resonance of a
link on a locked motor.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from acquisition.processing.smoothing import low_pass
from acquisition.signals.splines import quintic_derivatives
from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import convert_to_joints
from identification.elasticity.transmitted_torque import transmitted_torque
from identification.estimation.estimate import BLOCK_ROWS, Estimate
from identification.model.inertia import inertia_size

STEPS: Final = 20
SETTLED_RAD: Final = 1e-9
SHARE_OF_RESONANCE: Final = 0.5
"""Highest frequency of the deflection over the lowest resonance of a link on a locked motor; near
the resonance, errors of the stiffness are magnified."""


def has_stiffness(robot: RobotDescription) -> bool:
    """Return True if the stiffness of at least one gear is known."""
    return any(joint.stiffness_nm_rad is not None for joint in robot.joints)


def stiffness_nm_rad(robot: RobotDescription) -> FloatArray:
    """Return the stiffness of each gear, (n,) [N m/rad or N/m]; infinite if it is not known."""
    return np.array([joint.stiffness_nm_rad or math.inf for joint in robot.joints])


def damping_nm_s(robot: RobotDescription) -> FloatArray:
    """Return the damping of each gear, (n,) [N m s/rad or N s/m]; 0 if it is not known."""
    return np.array([joint.damping_nm_s or 0.0 for joint in robot.joints])


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


def deflection_band_hz(estimate: Estimate, position: FloatArray, step_s: float) -> float:
    """Return the highest frequency of the deflection that is computed [Hz].

    Args:
        estimate: Model of the links; its robot states the stiffness of at least one gear.
        position: Shape (samples, n). Positions of the motion [rad or m].
        step_s: Time between rows [s].
    """
    inertia = np.diagonal(inertia_size(estimate.model, estimate.base, position, estimate.values))
    lowest_rad_s = float(np.min(np.sqrt(stiffness_nm_rad(estimate.robot) / inertia)))
    return min(SHARE_OF_RESONANCE * lowest_rad_s / (2.0 * math.pi), 0.4 / step_s)


def gear_torque(estimate: Estimate, position: FloatArray, step_s: float) -> FloatArray:
    """Return how much more torque rigid gears would need for a motion of the motors.

    Args:
        estimate: Model of the links; its robot states the stiffness of at least one gear.
        position: Shape (samples, n). Positions of the motors without gaps [rad or m].
        step_s: Time between rows [s].

    Returns:
        Shape (samples, n) [N m or N], in the order of the motors.

    Raises:
        EstimationError: The deflection does not converge.
    """
    robot = estimate.robot
    stiffness, damping = stiffness_nm_rad(robot), damping_nm_s(robot)
    band_hz = deflection_band_hz(estimate, position, step_s)
    theta = low_pass(position, step_s, band_hz)

    def links_torque(bent: FloatArray) -> FloatArray:
        q = theta - convert_to_joints(robot, bent)
        motion = (q, *quintic_derivatives(q, step_s))
        torque = np.empty_like(q)
        for start in range(0, len(q), BLOCK_ROWS):
            rows = slice(start, start + BLOCK_ROWS)
            torque[rows] = transmitted_torque(estimate, robot, *(each[rows] for each in motion))
        return torque

    bent = np.zeros_like(theta)
    of_motors = torque = links_torque(bent)
    for _ in range(STEPS):
        bending = torque - damping * quintic_derivatives(bent, step_s)[0]
        step = low_pass(bending / stiffness, step_s, band_hz) - bent
        bent = bent + step
        torque = links_torque(bent)
        if np.abs(step).max() < SETTLED_RAD:
            return np.asarray(of_motors - torque)
    raise EstimationError(
        f"the deflection of the gears has not converged in {STEPS} steps: check the stiffness of"
        " the gears in the model's robot",
        code="RID-STIFFNESS-UNSETTLED",
    )
