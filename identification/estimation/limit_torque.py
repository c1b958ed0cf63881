"""`limit_torque`: the torque of a motion by which limits are held before it is driven.

Ahead of a motion nobody knows how warm joints are. Of joints that warm up by their own friction
both ends are known: torque is linear in the temperature, so that no state in between takes more
than the larger of cold and warm.
"""

from __future__ import annotations

import numpy as np

from config.arrays import FloatArray
from config.plausible import ZERO_CELSIUS_K
from dynamics.terms.conditions import Conditions
from identification.estimation.at_temperature import by_temperature
from identification.estimation.estimate import Estimate, predict


def limit_torque(
    estimate: Estimate, position: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> FloatArray:
    """Return the torques that limits are held by, shape (samples, n) [N m or N].

    Where friction depends on temperature: at the reference temperatures and, where joints warm up
    by their own friction, as warm as the motion makes them that is repeated; of each sample the
    larger.

    Args:
        estimate: The model.
        position, velocity, acceleration: Shape (samples, n). The whole motion [rad or m, per
            second, per second squared].
    """
    if not by_temperature(estimate).any():
        return predict(estimate, position, velocity, acceleration)
    robot = estimate.robot
    reference_k = np.array([joint.reference_temperature_k for joint in robot.joints])
    moved = (position, velocity, acceleration)
    cold = predict(estimate, *moved, Conditions(temperature_k=reference_k))
    if estimate.warming is None:
        return cold
    settled = Conditions(temperature_k=estimate.warming.settled(robot, velocity))
    warm = predict(estimate, *moved, settled)
    return np.where(np.abs(warm) > np.abs(cold), warm, cold)


def limit_warmth(estimate: Estimate) -> str:
    """Return how warm `limit_torque` takes joints to be; empty where friction does not depend."""
    depends = by_temperature(estimate)
    joints = [joint for joint, own in zip(estimate.robot.joints, depends, strict=True) if own]
    if not joints:
        return ""
    if estimate.warming is None:
        each = ", ".join(
            f"{joint.name} {joint.reference_temperature_k - ZERO_CELSIUS_K:.3g} °C"
            for joint in joints
        )
        return (
            f"Torque limits are held with friction at reference_temperature_k ({each}); at other"
            " temperatures the motion may take more."
        )
    return (
        f"Torque limits are held with the friction of {', '.join(joint.name for joint in joints)}"
        " both as after a long rest and as the motion makes it."
    )
