"""`refuse_light_axes`: compare the apparent inertia of each axis with that of the drawn arm.

The fit of a velocity controller does not show a wrong unit of the torques: gain, inertia and
damping change by the same factor. The inertia of the arm is known from `cad` or, roughly, from its
size.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from compensation.loops.cascade import Cascade
from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel, torque
from identification.model.drawn_arm import drawn_parameters, plausible_weight
from identification.regression.fit_grade import BAD_SHARE


def refuse_light_axes(
    cascades: Sequence[Cascade], robot: RobotDescription, position: FloatArray
) -> None:
    """Refuse torques that accelerate an axis as if its links were far too light.

    Rotors, payloads and the other joints' loops change an inertia, so that only its lower limit is
    known: that of `plausible_weight`. An axis that is not a single inertia is not judged, and
    neither is a robot with a coupled wrist, whose loops belong to the motors.

    Args:
        cascades: The fitted loops.
        robot: The robot.
        position: Shape (n,). Pose of the measurement [rad or m].

    Raises:
        EstimationError: The upper end of the 2-sigma interval of an inertia is below the limit.
    """
    if robot.coupling is not None:
        return
    drawn, least = drawn_inertias(robot, position), plausible_weight(robot)[0]
    for cascade in cascades:
        axis, joint = cascade.mechanics, robot.joint_names.index(cascade.loop.joint_name)
        highest = axis.inertia + 2.0 * math.sqrt(float(axis.covariance[0, 0]))
        if axis.misfit <= BAD_SHARE and highest < least * drawn[joint]:
            unit = "kg" if robot.joints[joint].unit == "m" else "kg m²"
            source = "`cad`" if robot.is_drawn else "the size"
            raise EstimationError(
                f"joint {axis.joint_name}: the torque accelerates an inertia of"
                f" {axis.inertia:.3g} {unit}, but the links have {drawn[joint]:.3g} {unit} by"
                f" {source} of the robot file, so the gain of the loop is wrong: check the unit and"
                " the constant of the torque, the gear ratio, the lengths and `cad`",
                code="RID-LOOP-INERTIA",
            )


def drawn_inertias(robot: RobotDescription, position: FloatArray) -> FloatArray:
    """Return the inertia of the links about each joint, from `cad` or the arm's size, shape (n,).

    Args:
        robot: A robot without a coupled wrist.
        position: Shape (n,). The pose [rad or m].
    """
    model, n = RobotModel.from_description(robot), len(robot.joints)
    parameters = drawn_parameters(model, robot)
    at, still = np.tile(position, (n, 1)), np.zeros((n, n))
    needed = torque(model, at, still, np.eye(n), parameters)
    held = torque(model, at, still, still, parameters)
    return np.asarray(np.diagonal(needed - held), dtype=np.float64)
