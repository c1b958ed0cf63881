"""Coupled wrists, q = C alpha (5.18, 5.19), compared with bodies, energies and virtual work."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.robot.wrist_coupling import WristCoupling
from dynamics.model.inverse_dynamics import mass_matrix
from dynamics.model.robot_model import (
    RobotModel,
    base_wrench_regressor,
    load_torque,
    regressor,
    torque,
)
from dynamics.terms.conditions import Conditions
from dynamics.terms.motion import TermMotion

PINOCCHIO_ORDER = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]
STEP = 1e-4


def with_coupling(robot, seed: int):
    """Return the robot with motors that move their own joint and, slightly, all others."""
    n = len(robot.joints)
    matrix = np.eye(n) + np.random.default_rng(seed).uniform(-0.4, 0.4, (n, n))
    return robot.model_copy(update={"coupling": tuple(map(tuple, matrix.tolist()))})


def without_friction(robot) -> RobotModel:
    return RobotModel.from_description(robot, friction=False, spring=False)


def real_rotors(robot, links: np.ndarray, polar: np.ndarray):
    """Return each rotor as a body of 0.5 kg, and the links' parameters with these bodies added."""
    rng = np.random.default_rng(len(polar))
    bodies, lumped = [], links.copy()
    for joint, inertia in zip(robot.joints, polar, strict=True):
        along = np.outer(joint.rotor.axis, joint.rotor.axis)
        body = pin.Inertia(0.5, np.zeros(3), inertia * along + 0.6 * inertia * (np.eye(3) - along))
        placement = pin.SE3(np.eye(3), rng.uniform(-0.2, 0.2, 3))
        bodies.append((placement, body))
        if joint.rotor.link:
            ten = placement.act(body).toDynamicParameters()[PINOCCHIO_ORDER]
            lumped[joint.rotor.link - 1] += ten
    return bodies, lumped


@pytest.mark.parametrize("n", range(2, 8))
@pytest.mark.parametrize("seed", range(3))
def test_coupled_rotors_agree_with_separate_bodies(
    n, seed, random_arm, judge, random_links, random_motion
) -> None:
    """Pinocchio's rotors spin at mu alpha' relative to the links that carry them."""
    robot = with_coupling(random_arm(n, 20 * n + seed), seed)
    links, polar = random_links(n, seed), np.random.default_rng(seed).uniform(0.01, 0.2, n)
    bodies, lumped = real_rotors(robot, links, polar)
    reference = judge(robot, links, bodies)
    q, v, a = random_motion(n, seed)

    on_joints = np.array([reference.torque(*s) for s in zip(q, v, a, strict=True)])
    expected = on_joints @ np.array(robot.coupling)  # tau_alpha = C^T tau_q
    theta = np.concatenate([lumped.ravel(), polar])
    tau = torque(without_friction(robot), q, v, a, theta)
    np.testing.assert_allclose(tau, expected, rtol=0, atol=1e-9)


def test_the_base_wrench_of_coupled_rotors_agrees_with_bodies(
    random_arm, judge, random_links, random_motion
) -> None:
    """No rotor is mounted on the base."""
    robot = with_coupling(random_arm(4, 5, "RRPR"), 5)
    joints = [
        joint.model_copy(update={"rotor": joint.rotor.model_copy(update={"link": max(i, 1)})})
        for i, joint in enumerate(robot.joints)
    ]
    robot = robot.model_copy(update={"joints": tuple(joints)})
    links, polar = random_links(4, 5), np.array([0.1, 0.2, 0.05, 0.3])
    bodies, lumped = real_rotors(robot, links, polar)
    reference = judge(robot, links, bodies)
    q, v, a = random_motion(4, 5)
    expected = np.array([reference.base_wrench(*s) for s in zip(q, v, a, strict=True)])
    theta = np.concatenate([lumped.ravel(), polar])
    wrench = base_wrench_regressor(without_friction(robot), q, v, a) @ theta
    np.testing.assert_allclose(wrench, expected, rtol=0, atol=1e-9)


def test_torques_obey_lagranges_equations_in_the_actuators_coordinates(
    random_arm, judge, random_links
) -> None:
    """Compare with Lagrange's equations in alpha, by differences of Pinocchio's energies."""
    robot = with_coupling(random_arm(3, 8, "RPR"), 8)
    matrix = np.array(robot.coupling)
    links, polar = random_links(3, 8), np.array([0.02, 0.05, 0.03])
    bodies, lumped = real_rotors(robot, links, polar)
    reference = judge(robot, links, bodies)
    data = reference.model.createData()

    def lagrangian(alpha: np.ndarray, speed: np.ndarray) -> float:
        q, v = reference.spread @ matrix @ alpha, reference.spread @ matrix @ speed
        kinetic = pin.computeKineticEnergy(reference.model, data, q, v)
        return float(kinetic - pin.computePotentialEnergy(reference.model, data, q))

    def by_speed(alpha: np.ndarray, speed: np.ndarray) -> np.ndarray:
        steps = STEP * np.eye(3)
        return np.array(
            [(lagrangian(alpha, speed + s) - lagrangian(alpha, speed - s)) for s in steps]
        ) / (2 * STEP)

    rng = np.random.default_rng(8)
    alpha, speed, push = rng.uniform(-1.0, 1.0, (3, 3))
    dt = 1e-4
    momenta = [by_speed(alpha + speed * t + push * t**2 / 2, speed + push * t) for t in (dt, -dt)]
    by_position = np.array(
        [lagrangian(alpha + s, speed) - lagrangian(alpha - s, speed) for s in STEP * np.eye(3)]
    ) / (2 * STEP)
    expected = (momenta[0] - momenta[1]) / (2 * dt) - by_position

    q, v, a = ((matrix @ x)[np.newaxis] for x in (alpha, speed, push))
    tau = torque(without_friction(robot), q, v, a, np.concatenate([lumped.ravel(), polar]))[0]
    np.testing.assert_allclose(tau, expected, rtol=1e-5, atol=1e-4)


class TestWristOfTheThesis:
    """Coupling of axes 4 to 6 of the thesis, applied to the three axes of the bundled arm.

    Motor 4 also moves axes 5 and 6, motor 5 also axis 6.
    """

    COUPLING = ((1.0, 0.0, 0.0), (-0.025, 1.0, 0.0), (0.012, -0.3, 1.0))

    @pytest.fixture
    def robot(self, ir361):
        return ir361.model_copy(update={"coupling": self.COUPLING})

    @pytest.fixture
    def model(self, robot) -> RobotModel:
        return RobotModel.from_description(robot)

    def test_the_links_columns_are_multiplied_by_the_transposed_coupling(
        self, model, ir361, random_motion
    ) -> None:
        """Check equations (5.18) and (5.19) for the columns of the links."""
        q, v, a = random_motion(3, 0)
        uncoupled = regressor(RobotModel.from_description(ir361), q, v, a)[:, :, :30]
        expected = np.einsum("ji,sjp->sip", np.array(self.COUPLING), uncoupled)
        np.testing.assert_allclose(regressor(model, q, v, a)[:, :, :30], expected, atol=1e-12)

    def test_friction_depends_on_the_actuators_speeds(self, model, random_motion) -> None:
        q, v, a = random_motion(3, 1)
        speed = np.linalg.solve(np.array(self.COUPLING), v.T).T
        phi = regressor(model, q, v, a)
        for j in range(3):
            coulomb = phi[:, :, model.parameter_names.index(f"fc_axis{j + 1}")]
            viscous = phi[:, :, model.parameter_names.index(f"fv_axis{j + 1}")]
            np.testing.assert_allclose(viscous[:, j], speed[:, j])
            np.testing.assert_array_equal(coulomb[:, j], np.sign(speed[:, j]))
            assert not np.delete(coulomb, j, axis=1).any()
            assert not np.delete(viscous, j, axis=1).any()

    def test_the_springs_torque_is_distributed_to_every_actuator_that_stretches_it(
        self, model, ir361
    ) -> None:
        """Virtual work: the torque along each actuator is the derivative of the spring's energy."""
        l, r = ir361.spring.l_m, ir361.spring.r_m  # noqa: E741
        stiffness, free = 8000.0, 0.35

        def energy(alpha: np.ndarray) -> np.ndarray:
            angle = (alpha @ np.array(self.COUPLING).T)[:, 1]
            length = np.sqrt(l**2 + r**2 - 2 * l * r * np.cos(angle))
            return 0.5 * stiffness * (length - free) ** 2

        alpha = np.random.default_rng(2).uniform(-1.0, 1.0, (9, 3))
        slopes = [(energy(alpha + s) - energy(alpha - s)) / (2 * STEP) for s in STEP * np.eye(3)]
        q = alpha @ np.array(self.COUPLING).T
        phi = regressor(model, q, 0 * q, 0 * q)[:, :, model.parameter_groups["spring"]]
        np.testing.assert_allclose(
            phi @ [stiffness, stiffness * free], np.transpose(slopes), atol=1e-4
        )


def test_the_mass_matrix_contains_all_bodies(random_arm, judge, random_links) -> None:
    """The reference is Pinocchio's torque for a unit acceleration of each joint from rest."""
    robot = with_coupling(random_arm(4, 9, "RRPR"), 9)
    links, polar = random_links(4, 9), np.array([0.1, 0.02, 0.05, 0.03])
    bodies, lumped = real_rotors(robot, links, polar)
    reference = judge(robot, links, bodies)
    q = np.random.default_rng(9).uniform(-1.0, 1.0, (3, 4))
    theta = np.concatenate([lumped.ravel(), polar])
    inertia = mass_matrix(without_friction(robot), q, theta)
    rest = np.zeros(4)
    for ours, sample in zip(inertia, q, strict=True):
        weight = reference.torque(sample, rest, rest)
        expected = [reference.torque(sample, rest, unit) - weight for unit in np.eye(4)]
        np.testing.assert_allclose(ours, expected, rtol=0, atol=1e-9)


def test_an_identity_coupling_changes_nothing(random_arm, random_motion) -> None:
    robot = random_arm(4, 1, "RRPR")
    same = robot.model_copy(update={"coupling": tuple(map(tuple, np.eye(4).tolist()))})
    q, v, a = random_motion(4, 1)
    np.testing.assert_allclose(
        regressor(RobotModel.from_description(same), q, v, a),
        regressor(RobotModel.from_description(robot), q, v, a),
        atol=1e-12,
    )


def test_gears_transmit_actuators_torques(ir361, random_motion) -> None:
    """The torque is C^T times the joint torques of links and spring.

    Rotors and friction act before the gear.
    """
    matrix = np.array(TestWristOfTheThesis.COUPLING)
    robot = ir361.model_copy(update={"coupling": TestWristOfTheThesis.COUPLING})
    q, v, a = random_motion(3, 4)
    theta = np.random.default_rng(4).standard_normal(41)
    on_links = np.where((np.arange(41) < 30) | (np.arange(41) >= 39), theta, 0.0)
    expected = torque(RobotModel.from_description(ir361), q, v, a, on_links) @ matrix
    load = load_torque(RobotModel.from_description(robot), q, v, a, theta)
    np.testing.assert_allclose(load, expected, atol=1e-9)


@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1))
def test_joints_and_actuators_have_the_same_power(seed) -> None:
    """The power is the same in both coordinates: tau_alpha^T alpha' = tau_q^T q' for any C."""
    rng = np.random.default_rng(seed)
    matrix = np.eye(5) + rng.uniform(-0.15, 0.15, (5, 5))
    v, tau = rng.standard_normal((2, 6, 5))
    motion = TermMotion.of(v, v, v, 5, WristCoupling.of_matrix(matrix), Conditions())
    on_actuators = tau[:, :, np.newaxis].copy()
    motion.to_actuators(on_actuators)
    np.testing.assert_allclose(
        (on_actuators[:, :, 0] * motion.actuator[1]).sum(axis=1), (tau * v).sum(axis=1)
    )


def test_every_part_of_a_motion_has_both_coordinates(random_motion) -> None:
    matrix = np.array(TestWristOfTheThesis.COUPLING)
    conditions = Conditions(temperature_k=np.full((8, 3), 300.0), load_nm=np.ones((8, 3)))
    q, v, a = random_motion(3, 6)
    whole = TermMotion.of(q, v, a, 3, WristCoupling.of_matrix(matrix), conditions)
    parts = [whole.part(slice(*ends)) for ends in pairwise([0, 3, 8])]
    for part in parts:
        np.testing.assert_allclose(part.joint, part.actuator @ matrix.T, atol=1e-12)
    for name in ("joint", "actuator"):
        both = np.concatenate([getattr(part, name) for part in parts], axis=1)
        np.testing.assert_array_equal(both, getattr(whole, name))
    loads = [part.conditions.load_nm for part in parts]
    assert [None if load is None else len(load) for load in loads] == [3, 5]
