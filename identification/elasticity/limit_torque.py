"""`limit_torque`: predicted torque of a motion, for the check of torque limits before the motion.

The joints' temperatures during the motion are not known in advance. For joints that warm up by
their own friction, the two extremes are known: cold and warm. Torque is linear in the temperature.
Therefore the torque at any temperature in between does not exceed the larger of these two.
"""

from __future__ import annotations

import numpy as np

from config.arrays import FloatArray
from config.plausible import ZERO_CELSIUS_K
from dynamics.terms.conditions import Conditions
from identification.elasticity.gear_torque import motor_torque
from identification.estimation.at_temperature import depends_on_temperature
from identification.estimation.estimate import Estimate


def limit_torque(
    estimate: Estimate,
    position: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    step_s: float,
) -> FloatArray:
    """Return the torques to compare with torque limits, shape (samples, n) [N m or N].

    If friction depends on temperature, the torques are those at the reference temperatures. If
    joints warm up by their own friction, the steady state of the repeated motion is also computed,
    and each sample is the one with the larger magnitude.

    Args:
        estimate: The model.
        position, velocity, acceleration: Shape (samples, n). The whole motion of the motors [rad or
            m, per second, per second squared].
        step_s: Time between rows [s].

    Raises:
        EstimationError: The deflection of elastic gears does not converge.
    """
    moved = (position, velocity, acceleration, step_s)
    if not depends_on_temperature(estimate).any():
        return motor_torque(estimate, *moved)
    robot = estimate.robot
    reference_k = np.array([joint.reference_temperature_k for joint in robot.joints])
    cold = motor_torque(estimate, *moved, Conditions(temperature_k=reference_k))
    if estimate.warming is None:
        return cold
    settled = Conditions(temperature_k=estimate.warming.steady_temperatures(robot, velocity))
    warm = motor_torque(estimate, *moved, settled)
    return np.where(np.abs(warm) > np.abs(cold), warm, cold)


def limit_temperature_note(estimate: Estimate) -> str:
    """Return a sentence on the temperatures in `limit_torque`; empty if they have no effect."""
    depends = depends_on_temperature(estimate)
    joints = [joint for joint, own in zip(estimate.robot.joints, depends, strict=True) if own]
    if not joints:
        return ""
    if estimate.warming is None:
        each = ", ".join(
            f"{joint.name} {joint.reference_temperature_k - ZERO_CELSIUS_K:.3g} °C"
            for joint in joints
        )
        return (
            f"The check of torque limits uses the friction at reference_temperature_k ({each});"
            " at other temperatures the torque may be larger."
        )
    return (
        "The check of torque limits uses the friction of"
        f" {', '.join(joint.name for joint in joints)} after a long rest, and in the steady state"
        " of the repeated motion."
    )
