"""Gear losses (5.16, 5.17): known results of a weight on a winch; a gear never adds power."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.errors import EstimationError
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.robot import Joint, JointLimits, RobotDescription
from dynamics.model.robot_model import RobotModel, load_torque, regressor, torque
from dynamics.terms.conditions import Conditions
from tests.builders.raised_codes import raises_code

LIMITS = JointLimits(
    position_min=-3.0, position_max=3.0, velocity=3.0, acceleration=9.0, torque=99.0
)
MOMENT = 4.0  # kg m
GRAVITY = 9.81


def pendulum(**joint: object) -> RobotDescription:
    """Return one horizontal axis; at zero its arm is horizontal, and positive motion lifts it."""
    return RobotDescription(
        name="pendulum",
        kinematics=Kinematics(
            convention="modified_dh", rows=(KinematicRow(alpha_rad=np.pi / 2.0),)
        ),
        joints=(Joint.model_validate({"name": "j", "limits": LIMITS, "friction": ()} | joint),),
    )


def weigh(model: RobotModel, v: list[float], parameters: dict[str, float]) -> np.ndarray:
    """Return the motor torque [N m] at angle zero for some speeds [rad/s]."""
    theta = np.array([parameters.get(name, 0.0) for name in model.parameter_names])
    speed = np.array(v)[:, np.newaxis]
    return torque(model, 0 * speed, speed, 0 * speed, theta)[:, 0]


def test_efficiency_applies_in_both_directions() -> None:
    """Lifting, the motor supplies load / eta (5.16); lowering, it holds eta load (5.17)."""
    model = RobotModel.from_description(pendulum(efficiency=0.8))
    load = MOMENT * GRAVITY
    np.testing.assert_allclose(
        weigh(model, [1.0, -1.0, 0.0], {"sx1": MOMENT}), [load / 0.8, load * 0.8, load]
    )


def test_load_friction_grows_with_the_transmitted_load() -> None:
    model = RobotModel.from_description(pendulum(friction=("coulomb", "load"))).with_nonlinear(
        [0.1]
    )
    load = MOMENT * GRAVITY
    np.testing.assert_allclose(
        weigh(model, [1.0, -1.0], {"sx1": MOMENT, "fc_j": 5.0}),
        [load + 0.1 * load + 5.0, load - 0.1 * load - 5.0],
    )


def test_motor_side_terms_are_not_transmitted() -> None:
    """Equation 5.15: armature and friction are subtracted from the motor's torque; the gear losses
    act on the rest only.
    """
    model = RobotModel.from_description(
        pendulum(efficiency=0.5, armature=True, friction=("coulomb", "viscous"))
    )
    names = model.parameter_names
    phi = regressor(model, [[0.0]], [[2.0]], [[3.0]], Conditions(load_nm=np.array([[1.0]])))[0, 0]
    assert phi[names.index("Ia1")] == 3.0
    assert phi[names.index("fc_j")] == 1.0
    assert phi[names.index("fv_j")] == 2.0
    assert phi[names.index("Izz1")] == pytest.approx(3.0 / 0.5)


def test_the_torque_function_computes_the_load(ir361, random_motion) -> None:
    """The torques of links and spring pass through the gear; those of rotor and friction do not."""
    first, *others = ir361.joints
    joints = (first.model_copy(update={"efficiency": 0.7}), *others)
    robot = ir361.model_copy(update={"joints": joints})
    lossy, lossless = map(RobotModel.from_description, (robot, ir361))
    q, v, a = random_motion(3, 0)
    theta = np.random.default_rng(0).standard_normal(41)
    load = load_torque(lossy, q, v, a, theta)
    np.testing.assert_allclose(load, load_torque(lossless, q, v, a, theta))
    expected = torque(lossless, q, v, a, theta)
    drives = load[:, 0] * v[:, 0] > 0.0
    expected[:, 0] += np.where(drives, 1 / 0.7 - 1.0, 0.7 - 1.0) * load[:, 0]
    np.testing.assert_allclose(torque(lossy, q, v, a, theta), expected)
    phi = regressor(lossy, q, v, a, Conditions(load_nm=load))
    np.testing.assert_allclose(phi @ theta, expected)


@settings(max_examples=30)
@given(
    efficiency=st.floats(0.2, 1.0),
    share=st.floats(0.0, 0.5),
    seed=st.integers(0, 1000),
)
def test_a_gear_never_outputs_more_power_than_its_input(efficiency, share, seed) -> None:
    rng = np.random.default_rng(seed)
    q, v, a = rng.uniform(-2.0, 2.0, (3, 6, 1))
    theta = rng.standard_normal(10)
    for joint, loss in (
        ({"efficiency": 1.0}, efficiency),
        ({"friction": ("load",)}, share),
    ):
        model = RobotModel.from_description(pendulum(**joint)).with_nonlinear([loss])
        behind = load_torque(model, q, v, a, theta)
        assert np.all((torque(model, q, v, a, theta) - behind) * v >= -1e-9)


def test_losses_without_the_load_are_refused() -> None:
    model = RobotModel.from_description(pendulum(efficiency=0.8))
    with raises_code(EstimationError, "RID-API-ARGUMENT", "eta_j", "load_torque"):
        regressor(model, *np.ones((3, 2, 1)))


def test_a_load_of_another_shape_is_refused() -> None:
    model = RobotModel.from_description(pendulum(efficiency=0.8))
    q, v, a = np.ones((3, 2, 1))
    with raises_code(EstimationError, "RID-API-ARGUMENT", "load_nm"):
        regressor(model, q, v, a, Conditions(load_nm=np.ones(1)))


def test_losses_are_nonlinear_parameters_with_ranges() -> None:
    model = RobotModel.from_description(pendulum(efficiency=0.8))
    assert model.nonlinear_names == ("eta_j",)
    assert model.nonlinear_units == ("1",)
    np.testing.assert_array_equal(model.nonlinear_bounds, [[0.2, 1.0]])
    model = RobotModel.from_description(pendulum(friction=("load",)))
    assert model.nonlinear_names == ("cl_j",)
    assert model.parameter_names[10:] == ()
    assert (
        RobotModel.from_description(pendulum(friction=("load",)), friction=False).nonlinear_names
        == ()
    )
