"""Derivatives of the torque by its nonlinear parameters, compared with central differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from config.load import load_robot
from config.robot.friction_terms import FrictionTerm
from dynamics.model.nonlinear_slopes import nonlinear_slopes
from dynamics.model.robot_model import RobotModel, load_torque, regressor
from dynamics.terms.conditions import Conditions


@pytest.mark.parametrize(
    ("friction", "efficiency"),
    [
        (("coulomb", "viscous", "stribeck"), None),
        (("coulomb", "load"), None),
        (("coulomb", "stribeck"), 0.85),
    ],
)
def test_derivatives_agree_with_central_differences(
    friction: tuple[FrictionTerm, ...], efficiency: float | None
) -> None:
    robot = load_robot("ir361")
    change = {"friction": friction, "efficiency": efficiency}
    joints = tuple(joint.model_copy(update=change) for joint in robot.joints)
    model = RobotModel.from_description(robot.model_copy(update={"joints": joints}))
    random = np.random.default_rng(1)
    q, v, a = random.normal(size=(3, 40, 3))
    v *= 0.1
    theta = random.normal(size=len(model.parameter_names))
    conditions = Conditions(load_nm=load_torque(model, q, v, a, theta))
    slopes = nonlinear_slopes(model, q, v, a, theta, conditions)
    assert slopes.shape == (40, 3, len(model.nonlinear_names))
    step = 1e-6
    for k in range(slopes.shape[2]):
        up, down = (
            regressor(
                model.with_nonlinear(
                    model.nonlinear_values + side * np.eye(len(model.nonlinear_names))[k]
                ),
                q,
                v,
                a,
                conditions,
            )
            @ theta
            for side in (step, -step)
        )
        np.testing.assert_allclose(
            slopes[:, :, k], (up - down) / (2.0 * step), rtol=1e-4, atol=1e-6
        )


def test_a_model_without_nonlinear_parameters_has_no_derivatives() -> None:
    model = RobotModel.from_description(load_robot("ir361"))
    theta = np.zeros(len(model.parameter_names))
    q, v, a = np.zeros((3, 5, 3))
    assert nonlinear_slopes(model, q, v, a, theta).shape == (5, 3, 0)
    assert replace(model).nonlinear_names == ()
