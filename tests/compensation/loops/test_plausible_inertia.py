"""The inertia that a torque accelerates is compared with that of the drawn arm."""

from __future__ import annotations

import numpy as np
import pytest

from compensation.loops.axis_mechanics import AxisMechanics
from compensation.loops.cascade import Cascade
from compensation.loops.plausible_inertia import drawn_inertias, refuse_light_axes
from compensation.loops.velocity_loop import VelocityLoop
from config.errors import EstimationError
from config.load import load_robot
from config.robot.nominal_links import nominal_links
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain
from tests.builders.raised_codes import raises_code

ROBOT = load_robot("ir361")
POSE = np.array([0.3, -0.4, 0.9])


def drawn() -> RobotDescription:
    """Return the arm with the masses of solid cylinders in `cad`."""
    chain = Chain.from_description(ROBOT)
    links = nominal_links(chain.rows, chain.tool_m)
    known = tuple(link.model_copy(update={"uncertainty": 0.1}) for link in links)
    return ROBOT.model_copy(update={"cad": known})


def measured(share: float, misfit: float = 0.05) -> list[Cascade]:
    """Return loops of axes whose torques accelerate a share of the drawn inertia."""
    cascades = []
    for name, own in zip(ROBOT.joint_names, drawn_inertias(ROBOT, POSE), strict=True):
        inertia = share * float(own)
        names = ("gain", "integral_time_s")
        loop = VelocityLoop(name, 500.0, 0.08, 0.0, 0.0, names, np.eye(2), 1.0, ())
        covariance = np.diag([(misfit * inertia) ** 2, 1.0])
        axis = AxisMechanics(name, inertia, 1.0, covariance, misfit, 0.01)
        cascades.append(Cascade(loop, axis, 15.0, 0.008))
    return cascades


@pytest.mark.parametrize(("robot", "least"), [(drawn(), 0.3), (ROBOT, 0.02)])
def test_a_torque_that_accelerates_too_little_is_refused(
    robot: RobotDescription, least: float
) -> None:
    refuse_light_axes(measured(1.05 * least), robot, POSE)
    with raises_code(EstimationError, "RID-LOOP-INERTIA", "axis1"):
        refuse_light_axes(measured(0.8 * least), robot, POSE)


def test_an_axis_that_is_not_one_inertia_is_not_judged() -> None:
    refuse_light_axes(measured(0.001, misfit=0.4), ROBOT, POSE)


def test_the_motors_of_a_coupled_wrist_are_not_judged() -> None:
    wrist = load_robot("kr15")
    assert wrist.coupling is not None
    refuse_light_axes(measured(0.001), wrist, np.zeros(6))
