from __future__ import annotations

import numpy as np
import pytest

from config.errors import ConfigError
from dynamics.robot_model import RobotModel, base_wrench_regressor, regressor
from dynamics.spring import Spring

STIFFNESS_N_PER_M, FREE_LENGTH_M = 8000.0, 0.35


@pytest.fixture
def model(ir361) -> RobotModel:
    return RobotModel.from_description(ir361, rotors=False, friction=False)


def spring_torque(model: RobotModel, q2: np.ndarray) -> np.ndarray:
    q = np.zeros((len(q2), 3))
    q[:, 1] = q2
    phi = regressor(model, q, 0 * q, 0 * q)[:, :, model.parameter_groups["spring"]]
    return phi @ [STIFFNESS_N_PER_M, STIFFNESS_N_PER_M * FREE_LENGTH_M]


def test_the_torque_is_the_slope_of_the_springs_energy(model, ir361) -> None:
    l, r = ir361.spring.l_m, ir361.spring.r_m  # noqa: E741
    q2, step = np.linspace(-3.0, 3.0, 61), 1e-6

    def energy(q):
        length = np.sqrt(l**2 + r**2 - 2 * l * r * np.cos(q))
        return 0.5 * STIFFNESS_N_PER_M * (length - FREE_LENGTH_M) ** 2

    slope = (energy(q2 + step) - energy(q2 - step)) / (2 * step)
    tau = spring_torque(model, q2)
    np.testing.assert_allclose(tau[:, 1], slope, atol=1e-5)
    assert not tau[:, [0, 2]].any()


def test_the_stiffness_column_is_collinear_with_link_2s_gravity(model) -> None:
    """So the two merge into one parameter, grav1 = l r k - g b2z (3.38)."""
    q = np.zeros((7, 3))
    q[:, 1] = np.linspace(-1.4, 1.0, 7)
    phi = regressor(model, q, 0 * q, 0 * q)[:, 1]
    gravity = phi[:, model.parameter_names.index("sx2")]
    stiffness = phi[:, model.parameter_names.index("k_spring")]
    moving = np.abs(stiffness) > 1e-9
    ratio = gravity[moving] / stiffness[moving]
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-9)
    assert ratio[0] < 0.0  # the spring pushes up what gravity pulls down


def test_names_and_units(ir361) -> None:
    spring = Spring.from_description(ir361)
    assert spring.parameter_names == ("k_spring", "P0_spring")
    assert spring.parameter_units == ("N/m", "N")


def test_the_base_does_not_feel_the_spring(model) -> None:
    phi = base_wrench_regressor(model, *np.ones((3, 4, 3)))
    assert not phi[:, :, model.parameter_groups["spring"]].any()


def test_a_spring_that_cannot_be_meant_is_refused(ir361) -> None:
    with pytest.raises(ConfigError, match="has no spring"):
        Spring.from_description(ir361.model_copy(update={"spring": None}))

    flat = ir361.spring.model_copy(update={"r_m": ir361.spring.l_m})
    with pytest.raises(ConfigError, match="ends would meet"):
        Spring.from_description(ir361.model_copy(update={"spring": flat}))

    first, second, third = ir361.joints
    sliding = (first, second.model_copy(update={"type": "prismatic"}), third)
    with pytest.raises(ConfigError, match="is prismatic"):
        Spring.from_description(ir361.model_copy(update={"joints": sliding}))
