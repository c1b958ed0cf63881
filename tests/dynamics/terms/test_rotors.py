"""Columns of the rotors, compared with rotors as bodies and with appendix D of the thesis."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from config.errors import EstimationError
from dynamics.model.robot_model import RobotModel, base_wrench_regressor, regressor, torque
from dynamics.terms.rotors import Rotors
from tests.builders.raised_codes import raises_code

PINOCCHIO_ORDER = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]


def with_rotors(robot) -> RobotModel:
    return RobotModel.from_description(robot, friction=False, spring=False)


@pytest.mark.parametrize("n", range(1, 8))
@pytest.mark.parametrize("seed", range(4))
def test_rotors_agree_with_separate_bodies(
    n, seed, random_arm, judge, random_links, random_motion
) -> None:
    """Each rotor is a body with mass and transverse inertia.

    It is mounted on the base or on any link up to the one that it moves, inclusive.
    """
    rng = np.random.default_rng(seed)
    robot = random_arm(n, 10 * n + seed)
    links = random_links(n, seed)
    polar = rng.uniform(0.01, 0.2, n)

    bodies, lumped = [], links.copy()
    on_base = pin.Inertia.Zero()
    for joint, inertia in zip(robot.joints, polar, strict=True):
        axis = np.array(joint.rotor.axis)
        along = np.outer(axis, axis)
        body = pin.Inertia(0.5, np.zeros(3), inertia * along + 0.6 * inertia * (np.eye(3) - along))
        placement = pin.SE3(np.eye(3), rng.uniform(-0.2, 0.2, 3))
        bodies.append((placement, body))
        if joint.rotor.link:
            ten = placement.act(body).toDynamicParameters()[PINOCCHIO_ORDER]
            lumped[joint.rotor.link - 1] += ten
        else:
            on_base += placement.act(body)

    reference = judge(robot, links, bodies)
    model, theta = with_rotors(robot), np.concatenate([lumped.ravel(), polar])
    q, v, a = random_motion(n, seed)
    samples = list(zip(q, v, a, strict=True))

    expected = np.array([reference.torque(*s) for s in samples])
    np.testing.assert_allclose(torque(model, q, v, a, theta), expected, rtol=0, atol=1e-10)

    gravity = pin.Motion(np.array(robot.gravity_m_s2), np.zeros(3))
    resting_on_base = -(on_base * gravity).vector
    expected = np.array([reference.base_wrench(*s) for s in samples]) - resting_on_base
    wrench = base_wrench_regressor(model, q, v, a) @ theta
    np.testing.assert_allclose(wrench, expected, rtol=0, atol=1e-10)


class TestAppendixD:
    """IR 361: motor 1 on the base, motors 2 (+Y) and 3 (-Y) both on link 2."""

    @pytest.fixture
    def motion(self, random_motion):
        return random_motion(3, 7)

    @pytest.fixture
    def column(self, ir361, motion):
        model = with_rotors(ir361)
        phi, names = regressor(model, *motion), model.parameter_names
        return lambda name: phi[:, :, names.index(name)]

    @pytest.fixture
    def ratios(self, ir361):
        return [joint.gear_ratio for joint in ir361.joints]

    def test_torque_of_actuator_2_agrees_with_appendix_d(self, column, motion, ratios) -> None:
        """Compare with (D.29), in which Im2 contains a part that our model assigns to the link's
        Izz2.
        """
        _, mu2, mu3 = ratios
        _, a2, a3 = motion[2].T
        np.testing.assert_allclose((column("Im2") + column("Izz2"))[:, 1], (1 + mu2) ** 2 * a2)
        np.testing.assert_allclose((column("Im3") + column("Izz2"))[:, 1], a2 - mu3 * a3)

    def test_torque_of_actuator_3_agrees_with_appendix_d(self, column, motion, ratios) -> None:
        *_, mu3 = ratios
        _, a2, a3 = motion[2].T
        np.testing.assert_allclose(column("Im3")[:, 2], mu3**2 * a3 - mu3 * a2)
        np.testing.assert_array_equal(column("Im2")[:, 2], 0.0)

    def test_torque_of_actuator_1_contains_only_its_own_rotor(self, column, motion, ratios) -> None:
        """Equations (D.33) and (D.34)."""
        mu1, *_ = ratios
        np.testing.assert_allclose(column("Im1")[:, 0], mu1**2 * motion[2, :, 0])
        for name in ("Im2", "Im3"):
            rotor, lumped = column(name)[:, 0], column("Izz2")[:, 0]
            np.testing.assert_allclose(rotor, 0.0, atol=1e-10)
            np.testing.assert_allclose(lumped, 0.0, atol=1e-10)


def test_a_motor_on_the_base_acts_on_it_with_its_gear_ratio_once(ir361, random_motion) -> None:
    """Rotor 1 turns on the base about -z at mu times the speed of joint 1.

    Only the moment I_M mu a about -z acts on the base, not mu^2 a.
    """
    q, v, a = random_motion(3, 1)
    model = with_rotors(ir361)
    wrench = base_wrench_regressor(model, q, v, a)[:, :, model.parameter_names.index("Im1")]
    expected = np.zeros((8, 6))
    expected[:, 5] = -ir361.joints[0].gear_ratio * a[:, 0]
    np.testing.assert_allclose(wrench, expected, atol=1e-12)


def test_joints_without_a_rotor_have_no_rotor_column(ir361) -> None:
    first, second, third = ir361.joints
    second = second.model_copy(update={"rotor": None})
    model = with_rotors(ir361.model_copy(update={"joints": (first, second, third)}))
    assert model.parameter_names[30:] == ("Im1", "Im3")
    assert model.parameter_units[30:] == ("kg m^2",) * 2


def test_a_rotor_beyond_the_link_that_it_moves_is_refused(ir361) -> None:
    chain = with_rotors(ir361).chain
    with raises_code(EstimationError, "RID-ROBOT-VALUE"):
        Rotors(chain, np.array([0]), np.array([2]), np.array([[0.0, 0.0, 1.0]]), np.ones(1))
    with raises_code(EstimationError, "RID-API-ARGUMENT"):
        Rotors(chain, np.array([0]), np.array([0]), np.ones((2, 3)), np.ones(1))
