from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.errors import EstimationError
from config.load import load_robot
from dynamics.model.inverse_dynamics import torque_derivatives
from dynamics.model.robot_model import RobotModel, base_wrench_regressor, regressor, torque
from dynamics.terms.conditions import Conditions
from dynamics.terms.friction import Friction
from tests.builders.raised_codes import raises_code

FIVE_TERMS = ("coulomb", "viscous", "offset", "cubic", "cube_root")


@pytest.fixture
def robot(ir361):
    """Axis 1 has five friction terms, axis 2 (prismatic) has one, axis 3 has none."""
    chosen = (FIVE_TERMS, ("viscous",), ())
    kinds = ("revolute", "prismatic", "revolute")
    joints = tuple(
        joint.model_copy(update={"friction": terms, "type": kind})
        for joint, terms, kind in zip(ir361.joints, chosen, kinds, strict=True)
    )
    return ir361.model_copy(update={"joints": joints, "spring": None})


def columns(robot, v, **options):
    model = RobotModel.from_description(robot, **options)
    phi = regressor(model, np.zeros_like(v), v, np.zeros_like(v))
    return phi[:, :, model.parameter_groups["friction"]]


def test_each_joint_has_its_selected_terms(robot) -> None:
    friction = Friction.from_description(robot)
    assert friction.parameter_names == (
        "fc_axis1", "fv_axis1", "fo_axis1", "f3_axis1", "fcr_axis1", "fv_axis2",
    )  # fmt: skip
    assert friction.parameter_units == (
        "N m", "N m s/rad", "N m", "N m (s/rad)^3", "N m (s/rad)^(1/3)", "N s/m",
    )  # fmt: skip


def test_columns_are_functions_of_that_joints_speed(robot) -> None:
    v = np.array([[-8.0, 3.0, 1.0], [0.0, 0.0, 0.0], [0.125, -1.0, 2.0]])
    phi = columns(robot, v)
    np.testing.assert_allclose(
        phi[:, 0, :5],
        [
            [-1.0, -8.0, 1.0, -512.0, -2.0],
            [0.0, 0.0, 1.0, 0.0, 0.0],
            [1.0, 0.125, 1.0, 0.125**3, 0.5],
        ],
    )
    np.testing.assert_array_equal(phi[:, 1, 5], v[:, 1])
    assert not phi[:, 0, 5].any()
    assert not phi[:, 1, :5].any()
    assert not phi[:, 2].any()


def test_a_smoothed_sign_is_one_at_speed_and_linear_through_zero(robot) -> None:
    v = np.array([[-1.0, 0, 0], [-1e-4, 0, 0], [1e-4, 0, 0], [1.0, 0, 0]])
    coulomb = columns(robot, v, sign_smoothing_rad_s=0.01)[:, 0, 0]
    np.testing.assert_allclose(coulomb, [-1.0, -0.01, 0.01, 1.0], rtol=1e-4)


@pytest.mark.parametrize("smoothing", [-0.1, np.nan, np.inf])
def test_an_invalid_smoothing_speed_is_refused(robot, smoothing) -> None:
    with raises_code(EstimationError, "RID-OPTION-RANGE", "sign_smoothing_rad_s"):
        RobotModel.from_description(robot, sign_smoothing_rad_s=smoothing)


def test_friction_has_no_effect_on_the_base(robot) -> None:
    model = RobotModel.from_description(robot)
    phi = base_wrench_regressor(model, *np.ones((3, 4, 3)))
    assert not phi[:, :, model.parameter_groups["friction"]].any()


def one_axis(ir361, *terms, kind: str = "revolute"):
    """Return the arm with friction on its first axis only, without rotors and spring."""
    first, *others = ir361.joints
    joints = (
        first.model_copy(
            update={"friction": terms, "type": kind, "stribeck_velocity": 0.2, "rotor": None}
        ),
        *(joint.model_copy(update={"friction": (), "rotor": None}) for joint in others),
    )
    return ir361.model_copy(update={"joints": joints, "spring": None})


def with_thinning_speed(robot, speed: float):
    """Return the robot with a shear-thinning speed in every joint."""
    joints = (joint.model_copy(update={"shear_thinning_velocity": speed}) for joint in robot.joints)
    return robot.model_copy(update={"joints": tuple(joints)})


def friction_torque(robot, coefficients, speed, conditions=None, **options) -> np.ndarray:
    model = RobotModel.from_description(robot, **options)
    assert len(model.parameter_names) == 30 + len(coefficients)
    v = np.zeros((len(speed), 3))
    v[:, 0] = speed
    theta = np.array([*(0.0,) * 30, *coefficients])
    tau = torque(model, 0.0 * v, v, 0.0 * v, theta, conditions)
    assert not tau[:, 1:].any()
    return tau[:, 0]


class TestAsymmetric:
    def test_asymmetric_friction_has_a_coefficient_for_each_direction(self, ir361) -> None:
        robot = one_axis(ir361, "asymmetric", "viscous")
        tau = friction_torque(robot, [5.0, 3.0, 2.0], [2.0, 0.0, -2.0])
        np.testing.assert_allclose(tau, [5.0 + 4.0, 0.0, -3.0 - 4.0])
        names = RobotModel.from_description(robot).parameter_names[30:]
        assert names == ("fcp_axis1", "fcn_axis1", "fv_axis1")

    def test_asymmetric_friction_equals_coulomb_friction_with_an_offset(self, ir361) -> None:
        """Compare with the formula derived in docs/theory.md, section 4, with and without
        smoothing.
        """
        speed = np.array([-1.0, -0.01, -1e-3, 1e-3, 0.02, 1.0])
        for smoothing in (0.0, 0.02):
            options = {"sign_smoothing_rad_s": smoothing}
            asymmetric = friction_torque(
                one_axis(ir361, "asymmetric"), [5.0, 3.0], speed, **options
            )
            robot = one_axis(ir361, "coulomb", "offset")
            np.testing.assert_allclose(
                asymmetric, friction_torque(robot, [4.0, 1.0], speed, **options)
            )

    def test_smoothed_asymmetric_friction_is_continuous_through_zero(self, ir361) -> None:
        speed = [-1e-9, 0.0, 1e-9]
        tau = friction_torque(
            one_axis(ir361, "asymmetric"), [5.0, 3.0], speed, sign_smoothing_rad_s=0.01
        )
        np.testing.assert_allclose(tau, 1.0, atol=1e-5)


class TestShearThinning:
    SPEED = np.array([-1.2, -0.4, -1e-6, 0.0, 1e-6, 0.4, 1.2])

    def test_shear_thinning_is_viscous_at_low_speed_and_logarithmic_at_high_speed(
        self, ir361
    ) -> None:
        robot = with_thinning_speed(one_axis(ir361, "shear_thinning"), 0.4)
        tau = friction_torque(robot, [10.0], self.SPEED)
        np.testing.assert_allclose(tau, 10.0 * 0.4 * np.arcsinh(self.SPEED / 0.4))
        assert tau[4] / 1e-6 == pytest.approx(10.0, rel=1e-5)
        fast, faster = friction_torque(robot, [10.0], [40.0, 80.0])
        assert faster - fast == pytest.approx(4.0 * np.log(2.0), rel=1e-4)

    def test_the_shear_thinning_speed_is_stated_and_not_estimated(self, ir361) -> None:
        model = RobotModel.from_description(
            with_thinning_speed(one_axis(ir361, "shear_thinning"), 0.4)
        )
        assert model.nonlinear_names == ()
        assert model.parameter_names[30:] == ("fvs_axis1",)
        assert model.parameter_units[30:] == ("N m s/rad",)

    def test_each_joint_has_its_own_shear_thinning_speed(self, ir361) -> None:
        joints = [
            joint.model_copy(
                update={"friction": ("shear_thinning",), "shear_thinning_velocity": speed}
            )
            for joint, speed in zip(ir361.joints, (0.1, 0.2, 0.4), strict=True)
        ]
        model = RobotModel.from_description(ir361.model_copy(update={"joints": tuple(joints)}))
        v = np.full((1, 3), 0.2)
        phi = regressor(model, 0 * v, v, 0 * v)[0][:, model.parameter_groups["friction"]]
        expected = [0.1 * np.arcsinh(2.0), 0.2 * np.arcsinh(1.0), 0.4 * np.arcsinh(0.5)]
        np.testing.assert_allclose(phi, np.diag(expected))

    def test_shear_thinning_has_a_slope_at_standstill(self, ir361) -> None:
        """A controller that linearises its model at rest gets the viscous friction of low
        speeds.
        """
        model = RobotModel.from_description(
            with_thinning_speed(one_axis(ir361, "shear_thinning"), 0.4)
        )
        rest = np.zeros((1, 3))
        theta = np.array([*(0.0,) * 30, 10.0])
        _, by_v, _ = torque_derivatives(model, rest, rest, rest, theta)
        assert by_v[0, 0, 0] == pytest.approx(10.0)


class TestStribeck:
    SPEED = np.array([-0.6, -0.2, -0.01, 0.0, 0.01, 0.2, 0.6])

    def test_stribeck_friction_falls_to_1_over_e_at_its_speed(self, ir361) -> None:
        """Equation (2.10)."""
        robot = one_axis(ir361, "coulomb", "stribeck")
        tau = friction_torque(robot, [10.0, 4.0], self.SPEED)
        v = self.SPEED
        np.testing.assert_allclose(tau, np.sign(v) * (10.0 + 4.0 * np.exp(-np.abs(v) / 0.2)))
        assert tau[5] == pytest.approx(10.0 + 4.0 * np.exp(-1.0))

    def test_the_stribeck_speed_is_a_nonlinear_parameter_with_the_files_start_value(
        self, ir361
    ) -> None:
        model = RobotModel.from_description(one_axis(ir361, "stribeck"))
        assert model.nonlinear_names == ("vs_axis1",)
        assert model.nonlinear_units == ("rad/s",)
        np.testing.assert_array_equal(model.nonlinear_values, [0.2])
        assert np.all(model.nonlinear_bounds[:, 0] < 0.2)
        assert np.all(model.nonlinear_bounds[:, 1] > 0.2)
        v = np.array([[0.3, 0.0, 0.0]])
        column = regressor(model.with_nonlinear([0.1]), 0 * v, v, 0 * v)[0, 0, 30]
        assert column == pytest.approx(np.exp(-3.0))
        np.testing.assert_array_equal(model.nonlinear_values, [0.2])

    def test_each_joint_has_its_own_stribeck_speed(self, ir361) -> None:
        joints = [
            joint.model_copy(update={"friction": ("stribeck",), "stribeck_velocity": speed})
            for joint, speed in zip(ir361.joints, (0.1, 0.2, 0.4), strict=True)
        ]
        model = RobotModel.from_description(ir361.model_copy(update={"joints": tuple(joints)}))
        v = np.full((1, 3), 0.2)
        phi = regressor(model, 0 * v, v, 0 * v)[0][:, model.parameter_groups["friction"]]
        np.testing.assert_allclose(phi, np.diag(np.exp([-2.0, -1.0, -0.5])))
        phi = regressor(model.with_nonlinear([0.2, 0.4, 0.1]), 0 * v, v, 0 * v)[0]
        phi = phi[:, model.parameter_groups["friction"]]
        np.testing.assert_allclose(phi, np.diag(np.exp([-1.0, -0.5, -2.0])))


class TestTemperature:
    def robot(self, ir361):
        robot = one_axis(ir361, "coulomb", "viscous", "temperature")
        first, *others = robot.joints
        first = first.model_copy(update={"reference_temperature_k": 300.0})
        return robot.model_copy(update={"joints": (first, *others)})

    def test_friction_changes_in_proportion_to_the_temperature_rise(self, ir361) -> None:
        warm = np.full((3, 3), 1.0) * np.array([[300.0], [310.0], [290.0]])
        speed = np.array([2.0, -2.0, 2.0])
        coefficients = fc, fv, fc_t, fv_t = [5.0, 3.0, -0.02, -0.1]
        tau = friction_torque(
            self.robot(ir361), coefficients, speed, Conditions(temperature_k=warm)
        )
        delta = np.array([0.0, 10.0, -10.0])
        expected = (fc + fc_t * delta) * np.sign(speed) + (fv + fv_t * delta) * speed
        np.testing.assert_allclose(tau, expected)

    def test_the_temperature_can_be_constant_for_the_whole_motion(self, ir361) -> None:
        coefficients, speed = [5.0, 3.0, -0.02, -0.1], np.array([2.0, -2.0])
        mean = Conditions(temperature_k=np.array([310.0, 0.0, 0.0]))
        row = Conditions(temperature_k=np.full((2, 3), 310.0))
        np.testing.assert_array_equal(
            friction_torque(self.robot(ir361), coefficients, speed, mean),
            friction_torque(self.robot(ir361), coefficients, speed, row),
        )

    def test_temperature_dependent_friction_requires_the_temperature(self, ir361) -> None:
        with raises_code(EstimationError, "RID-MODEL-TEMPERATURE", "fcT_axis1"):
            friction_torque(self.robot(ir361), np.ones(4), [1.0])
        wrong = Conditions(temperature_k=np.full((4, 3), 300.0))
        with raises_code(EstimationError, "RID-API-ARGUMENT", "temperature_k"):
            friction_torque(self.robot(ir361), np.ones(4), [1.0], wrong)


@pytest.mark.parametrize(
    ("kind", "units"),
    [
        ("revolute", ["N m", "N m", "N m", "N m/K", "N m s/(rad K)"]),
        ("prismatic", ["N", "N", "N", "N/K", "N s/(m K)"]),
    ],
)
def test_units_are_those_of_the_joint(ir361, kind, units) -> None:
    robot = one_axis(ir361, "asymmetric", "stribeck", "temperature", "load", kind=kind)
    model = RobotModel.from_description(robot)
    assert list(model.parameter_units[30:]) == units
    assert model.nonlinear_names == ("vs_axis1", "cl_axis1")
    assert model.nonlinear_units == ("rad/s" if kind == "revolute" else "m/s", "1")


@settings(max_examples=40)
@given(
    speed=st.floats(-3.0, 3.0),
    sizes=st.lists(st.floats(0.0, 50.0), min_size=6, max_size=6),
    smoothing=st.sampled_from([0.0, 0.05]),
)
def test_friction_with_positive_coefficients_dissipates(speed, sizes, smoothing) -> None:
    robot = one_axis(load_robot("ir361"), "coulomb", "viscous", "cubic", "cube_root", "stribeck")
    tau = friction_torque(robot, sizes[:5], [speed], sign_smoothing_rad_s=smoothing)
    assert tau[0] * speed >= 0.0
    robot = one_axis(load_robot("ir361"), "asymmetric")
    assert friction_torque(robot, sizes[4:], [speed])[0] * speed >= 0.0


@pytest.mark.parametrize("smoothing", [0.0, 0.1])
def test_derivatives_agree_with_central_differences_of_friction(ir361, smoothing) -> None:
    terms = ("asymmetric", "viscous", "cubic", "cube_root", "stribeck", "temperature")
    model = RobotModel.from_description(one_axis(ir361, *terms), sign_smoothing_rad_s=smoothing)
    warm = Conditions(temperature_k=np.full(3, 320.0))
    theta = np.array([*(0.0,) * 30, 5.0, 3.0, 2.0, 0.5, 1.5, 4.0, -0.02, -0.1])
    v, step = np.zeros((6, 3)), np.array([1e-6, 0.0, 0.0])
    v[:, 0] = [-1.5, -0.3, -0.02, 0.02, 0.3, 1.5]
    ahead, behind = v + step, v - step
    rest = np.zeros_like(v)
    slope = torque_derivatives(model, rest, v, rest, theta, warm)[1][:, 0, 0]
    difference = torque(model, rest, ahead, rest, theta, warm) - torque(
        model, rest, behind, rest, theta, warm
    )
    np.testing.assert_allclose(slope, difference[:, 0] / 2e-6, rtol=1e-6)
