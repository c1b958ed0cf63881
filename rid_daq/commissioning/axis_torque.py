"""`wrong_torque`: compare the torque of an axis in its axis test with the arm's weight in `cad`.

If a joint slowly lifts the arm, friction and weight both resist. The torque is then at least that
of the weight, and no friction explains a smaller one.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel, regressor
from identification.model.drawn_arm import drawn_parameters, plausible_weight
from identification.wiring.weight import is_counterbalanced

LEAST_LOAD: Final = 0.05
"""Smallest torque of the weight that is judged, as a fraction of the joint's torque limit.

A tool that is not in `cad` can change the sign of a smaller torque.
"""
MOST_FRICTION: Final = 0.5
"""Largest friction of a slow joint, as a fraction of its torque limit."""


def wrong_torque(rows: NDArray[Any], robot: RobotDescription, number: int) -> str:
    """Return the problem if an axis's torque contradicts `cad`, without full stop; empty if none.

    Nothing is compared if the robot file has no `cad`, the wrist is coupled, the joint has a
    counterbalance, or the motion does not lift the arm enough.

    Args:
        rows: Rows of the recording of the axis's motion.
        robot: The robot.
        number: Index of the axis.
    """
    joint = robot.joints[number]
    if not robot.is_drawn or robot.coupling is not None or is_counterbalanced(robot, number):
        return ""
    rows = rows[rows["valid"][:, number] == 1]
    speed = rows["target_velocity"][:, number]
    rows = rows[np.abs(speed) > 0.5 * np.abs(speed).max(initial=0.0)]
    if not len(rows):
        return ""
    model = RobotModel.from_description(robot, rotors=False, friction=False, spring=False)
    q = rows["position"].mean(axis=0, keepdims=True)
    still = np.zeros_like(q)
    weight = float((regressor(model, q, still, still) @ drawn_parameters(model, robot))[0, number])
    towards = float(np.sign(np.mean(rows["target_velocity"][:, number])))
    limit, unit = joint.limits.torque, joint.torque_unit
    if weight * towards < LEAST_LOAD * limit:
        return ""
    low, high = plausible_weight(robot)
    measured = towards * float(np.median(rows["torque_nm"][:, number]))
    needed = abs(weight)
    if low * needed <= measured <= high * needed + MOST_FRICTION * limit:
        return ""
    least = f"lifting the arm needs at least {needed:.3g} {unit} by `cad`"
    if measured < -low * needed:
        remedy = "the drive counts its torque with the opposite sign: see its manual"
    else:
        remedy = (
            "check unit and object of the torque in the axis's servo: torque, rated_torque_nm,"
            " rated_torque_units, rated_current_a, torque_constant_nm_per_a; then gear_ratio and"
            " the masses in the robot file"
        )
    return f"{least}, but the drive reports {measured:.3g} {unit}: {remedy}"
