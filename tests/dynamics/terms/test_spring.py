from __future__ import annotations

import numpy as np
import pytest

from config.errors import ConfigError
from dynamics.model.inverse_dynamics import torque_derivatives
from dynamics.model.robot_model import RobotModel, base_wrench_regressor, regressor, torque
from dynamics.terms.spring import Spring
from tests.builders.raised_codes import raises_code

STIFFNESS_N_PER_M, FREE_LENGTH_M = 8000.0, 0.35


@pytest.fixture
def model(ir361) -> RobotModel:
    return RobotModel.from_description(ir361, rotors=False, friction=False)


def spring_torque(model: RobotModel, q2: np.ndarray) -> np.ndarray:
    q = np.zeros((len(q2), 3))
    q[:, 1] = q2
    phi = regressor(model, q, 0 * q, 0 * q)[:, :, model.parameter_groups["spring"]]
    return phi @ [STIFFNESS_N_PER_M, STIFFNESS_N_PER_M * FREE_LENGTH_M]


def test_the_torque_is_the_derivative_of_the_springs_energy(model, ir361) -> None:
    l, r = ir361.spring.l_m, ir361.spring.r_m  # noqa: E741
    q2, step = np.linspace(-3.0, 3.0, 61), 1e-6

    def energy(q):
        length = np.sqrt(l**2 + r**2 - 2 * l * r * np.cos(q))
        return 0.5 * STIFFNESS_N_PER_M * (length - FREE_LENGTH_M) ** 2

    slope = (energy(q2 + step) - energy(q2 - step)) / (2 * step)
    tau = spring_torque(model, q2)
    np.testing.assert_allclose(tau[:, 1], slope, atol=1e-5)
    assert not tau[:, [0, 2]].any()


def test_the_stiffness_column_is_collinear_with_the_gravity_of_link_2(model) -> None:
    """The thesis has one parameter for spring and gravity, grav1 = l r k - g b2z (3.38)."""
    q = np.zeros((7, 3))
    q[:, 1] = np.linspace(-1.4, 1.0, 7)
    phi = regressor(model, q, 0 * q, 0 * q)[:, 1]
    gravity = phi[:, model.parameter_names.index("sx2")]
    stiffness = phi[:, model.parameter_names.index("k_spring")]
    moving = np.abs(stiffness) > 1e-9
    ratio = gravity[moving] / stiffness[moving]
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-9)
    assert ratio[0] < 0.0  # the spring pushes up, gravity pulls down


def test_physical_parameters_have_names_and_units(ir361) -> None:
    spring = Spring.from_description(ir361)
    assert spring.parameter_names == ("k_spring", "P0_spring")
    assert spring.parameter_units == ("N/m", "N")


def test_the_spring_has_no_effect_on_the_base(model) -> None:
    phi = base_wrench_regressor(model, *np.ones((3, 4, 3)))
    assert not phi[:, :, model.parameter_groups["spring"]].any()


def test_an_invalid_spring_is_refused(ir361) -> None:
    with raises_code(ConfigError, "RID-ROBOT-VALUE"):
        Spring.from_description(ir361.model_copy(update={"spring": None}))

    flat = ir361.spring.model_copy(update={"r_m": ir361.spring.l_m})
    with raises_code(ConfigError, "RID-ROBOT-VALUE"):
        Spring.from_description(ir361.model_copy(update={"spring": flat}))

    first, second, third = ir361.joints
    sliding = (first, second.model_copy(update={"type": "prismatic"}), third)
    with raises_code(ConfigError, "RID-ROBOT-VALUE"):
        Spring.from_description(ir361.model_copy(update={"joints": sliding}))


class TestFourierForm:
    """Equation (3.37): three harmonics of the angle replace the unknown distances l and r."""

    @pytest.fixture
    def model(self, ir361) -> RobotModel:
        spring = ir361.spring.model_copy(update={"form": "fourier", "l_m": None, "r_m": None})
        robot = ir361.model_copy(update={"spring": spring})
        return RobotModel.from_description(robot, rotors=False, friction=False)

    @staticmethod
    def columns(model: RobotModel, q2: np.ndarray) -> np.ndarray:
        q = np.zeros((len(q2), 3))
        q[:, 1] = q2
        phi = regressor(model, q, 0 * q, 0 * q)[:, :, model.parameter_groups["spring"]]
        assert not phi[:, [0, 2]].any()
        return phi[:, 1]

    def test_the_fourier_form_is_a_series_of_cosines_and_sines(self, model) -> None:
        q2 = np.linspace(-3.0, 3.0, 25)
        coefficients = a1, b1, a2, b2, a3, b3 = np.random.default_rng(0).standard_normal(6)
        expected = (
            a1 * np.cos(q2) + b1 * np.sin(q2)
            + a2 * np.cos(2 * q2) + b2 * np.sin(2 * q2)
            + a3 * np.cos(3 * q2) + b3 * np.sin(3 * q2)
        )  # fmt: skip
        np.testing.assert_allclose(self.columns(model, q2) @ coefficients, expected)

    def test_three_harmonics_suffice_for_the_ir361(self, model, ir361) -> None:
        """Example 3.4: the physical torque over the range of the axis is reproduced within 0.5 % of
        its peak.
        """
        limits = ir361.joints[1].limits
        q2 = np.linspace(limits.position_min, limits.position_max, 200)
        physical = RobotModel.from_description(ir361, rotors=False, friction=False)
        tau = spring_torque(physical, q2)[:, 1]
        columns = self.columns(model, q2)
        fit = columns @ np.linalg.lstsq(columns, tau, rcond=None)[0]
        assert np.abs(fit - tau).max() < 5e-3 * np.abs(tau).max()

    def test_fourier_parameters_have_names_and_units(self, model) -> None:
        names = model.parameter_names[model.parameter_groups["spring"]]
        assert " ".join(names) == ("A1_spring B1_spring A2_spring B2_spring A3_spring B3_spring")
        assert set(model.parameter_units[model.parameter_groups["spring"]]) == {"N m"}

    @pytest.mark.parametrize("form", ["physical", "fourier"])
    def test_derivatives_agree_with_central_differences(self, form, ir361) -> None:
        spring = ir361.spring.model_copy(update={"form": form})
        robot = ir361.model_copy(update={"spring": spring})
        model = RobotModel.from_description(robot, rotors=False, friction=False)
        theta = np.zeros(len(model.parameter_names))
        theta[30:] = np.random.default_rng(1).standard_normal(len(theta) - 30)
        q, step = np.zeros((9, 3)), np.array([0.0, 1e-6, 0.0])
        q[:, 1] = np.linspace(-2.0, 2.0, 9)
        rest = np.zeros_like(q)
        slope = torque_derivatives(model, q, rest, rest, theta)[0]
        ahead, behind = (torque(model, at, rest, rest, theta) for at in (q + step, q - step))
        np.testing.assert_allclose(slope[:, :, 1], (ahead - behind) / 2e-6, atol=1e-7)
