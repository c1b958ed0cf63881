"""`MotorReference`: motion of the motors with which elastic gears move the links as planned.

A gear of stiffness k and damping d that transmits the torque tau_link is bent by tau_link / (k + s
d), in which s is the Laplace variable. The motors therefore follow theta_d = q_d + tau_link,d / (k
+ s d), so that the links follow q_d. The torque of a motor contains its own inertia times theta_d''
and its friction at the velocity theta_d'.

The deflection contains frequencies up to 15 Hz only, because its derivatives magnify noise and
jumps of the planned acceleration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from acquisition.motion.samples import MotionSamples
from compensation.feedforward.inverse import append_return
from compensation.feedforward.periodic_rows import period_rows, with_period
from compensation.ramped_load import RampedLoad, evaluate_over, row_times
from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import convert_to_joints
from dynamics.model.robot_model import torque
from identification.elasticity.transmitted_torque import transmitted_torque
from identification.estimation.estimate import Estimate, predict

BAND_HZ: Final = 15.0
TAPER: Final = 0.8
"""Fraction of `BAND_HZ`; at higher frequencies the deflection is gradually reduced to zero."""


@dataclass(frozen=True, eq=False)
class MotorReference:
    """Motion of the motors, and the torques that they need.

    Attributes:
        samples: The motion of the motors, in joint coordinates.
        deflection: Shape (samples, n). theta_d - q_d [rad or m].
        torque_nm: Shape (samples, n). Motor torques, link side [N m or N].
    """

    samples: MotionSamples
    deflection: FloatArray
    torque_nm: FloatArray


def motor_reference(
    samples: MotionSamples, estimate: Estimate | RampedLoad, robot: RobotDescription
) -> MotorReference:
    """Return the motors' motion for a planned motion of the links.

    Args:
        samples: The planned motion.
        estimate: Model of the robot. If its load changes, the motion must have no periods.
        robot: Robot file with stiffness and damping of the gears; a gear of unknown stiffness
            counts as rigid.
    """
    samples = samples.whole()
    planned = (samples.position, samples.velocity, samples.acceleration)
    times_s = row_times(samples)
    transmitted = evaluate_over(
        estimate, times_s, lambda model: transmitted_torque(model, robot, *planned)
    )
    step_s = samples.sample_period_s
    closed = append_return(transmitted, step_s)
    bent = [each[: len(transmitted)] for each in gear_deflection(robot, closed, step_s)]
    if samples.samples_per_period is not None:
        own = gear_deflection(robot, transmitted[period_rows(samples)], step_s)
        pairs = zip(bent, own, strict=True)
        bent = [with_period(samples, rows, period) for rows, period in pairs]
    by_motors = bent
    bent = [convert_to_joints(robot, each) for each in by_motors]
    moved = replace(
        samples,
        position=planned[0] + bent[0],
        velocity=planned[1] + bent[1],
        acceleration=planned[2] + bent[2],
    )

    def needed_torque(model: Estimate) -> FloatArray:
        own_inertia = _motor_inertias(model, robot) * by_motors[2]
        friction = _friction(model, moved.position, moved.velocity, planned[2])
        return _without_friction(model, *planned) + own_inertia + friction

    needed = evaluate_over(estimate, times_s, needed_torque)
    return MotorReference(moved, bent[0], needed)


def gear_deflection(
    robot: RobotDescription, transmitted: FloatArray, step_s: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the deflection of periodic torques, and its first two derivatives.

    Args:
        transmitted: Shape (samples, n). One period of the torques that the gears transmit, in the
            order of the motors [N m or N].
        step_s: Time between rows [s].

    Returns:
        Each of shape (samples, n) [rad or m, per s, per s^2]; 0 for a gear of unknown stiffness.
    """
    rows = len(transmitted)
    frequency_hz = np.fft.rfftfreq(rows, step_s)[:, np.newaxis]
    s = 2j * math.pi * frequency_hz
    known = np.array([joint.stiffness_nm_rad is not None for joint in robot.joints])
    stiffness = np.array([joint.stiffness_nm_rad or 1.0 for joint in robot.joints])
    damping = np.array([joint.damping_nm_s or 0.0 for joint in robot.joints])
    above = np.clip((frequency_hz / BAND_HZ - TAPER) / (1.0 - TAPER), 0.0, 1.0)
    kept = 0.5 + 0.5 * np.cos(math.pi * above)
    bins = known * kept * np.fft.rfft(transmitted, axis=0) / (stiffness + s * damping)
    first, second, third = (np.fft.irfft(bins * s**k, n=rows, axis=0) for k in range(3))
    return first, second, third


def _motor_inertias(estimate: Estimate, robot: RobotDescription) -> FloatArray:
    """Return each motor's inertia at the gear's output, (n,); 0 if it is not known."""
    values = dict(zip(estimate.base.names, estimate.values.tolist(), strict=True))
    found = []
    for number, joint in enumerate(robot.joints, start=1):
        if f"Im{number}" in values:
            found.append(values[f"Im{number}"] * joint.gear_ratio**2)
        else:
            found.append(values.get(f"Ia{number}", joint.motor_inertia_kg_m2 or 0.0))
    return np.array(found)


def _without_friction(
    estimate: Estimate, q: FloatArray, v: FloatArray, a: FloatArray
) -> FloatArray:
    model, values = estimate.model, estimate.standard_values.copy()
    if "friction" in model.parameter_groups:
        values[model.parameter_groups["friction"]] = 0.0
    return torque(model, q, v, a, values)


def _friction(estimate: Estimate, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
    return predict(estimate, q, v, a) - _without_friction(estimate, q, v, a)
