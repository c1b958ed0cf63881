"""`transmitted_torque`: the torques that the gears transmit to the links."""

from __future__ import annotations

import numpy as np

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import load_torque
from dynamics.terms.conditions import Conditions
from identification.estimation.estimate import Estimate


def transmitted_torque(
    estimate: Estimate,
    robot: RobotDescription,
    position: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    *,
    payload: bool = False,
) -> FloatArray:
    """Return the torques that the gears transmit, at their outputs, (samples, n) [N m or N].

    The torques are those of the links and springs in the model, without friction. A motor's own
    inertia is left out if the model separates it from the links, or if the robot file states it
    (`motor_inertia_kg_m2`).

    Args:
        robot: Robot file with the motors' inertias.
        position, velocity, acceleration: Shape (samples, n). Motion of the joints.
        payload: True if the robot carries the payload whose parameters are in the estimate.
    """
    model = estimate.model
    motion = (position, velocity, acceleration)
    conditions = Conditions(payload=payload)
    torque = load_torque(model, *motion, estimate.standard_values, conditions)
    lumped = lumped_motors(estimate)
    inertia = [
        (joint.motor_inertia_kg_m2 or 0.0) if joint.name in lumped else 0.0
        for joint in robot.joints
    ]
    return np.asarray(torque - np.array(inertia) * model.actuator_speed(acceleration))


def lumped_motors(estimate: Estimate) -> tuple[str, ...]:
    """Return the names of the joints whose motor inertia the model does not separate."""
    names = set(estimate.base.names)
    return tuple(
        name
        for number, name in enumerate(estimate.robot.joint_names, start=1)
        if names.isdisjoint((f"Im{number}", f"Ia{number}"))
    )
