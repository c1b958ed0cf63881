from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.errors import ConfigError
from config.load import load_cell
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.robot import Joint, JointLimits, RobotDescription, Rotor
from config.simulation.plant import LinkInertia, PlantConfig, SimulatedAxis
from mock_hw.plant.rigid_bodies import BaseWrench, build_rigid_bodies
from tests.builders.raised_codes import raises_code

LIMITS = JointLimits(
    position_min=-3.0, position_max=3.0, velocity=3.0, acceleration=9.0, torque=99.0
)


def random_arm(seed: int, joints: int) -> tuple[RobotDescription, PlantConfig]:
    random = np.random.default_rng(seed)
    described, links, axes, rows = [], [], [], []
    for number in range(1, joints + 1):
        spin = random.normal(size=3)
        spin /= np.linalg.norm(spin)
        root = random.normal(size=(3, 3))
        xx, xy, xz, _, yy, yz, _, _, zz = (root @ root.T + np.eye(3)).ravel().tolist()
        alpha, beta, theta, a_m, d_m = random.normal(size=5).tolist()
        rows.append(KinematicRow(alpha_rad=alpha, beta_rad=beta, theta_rad=theta, a_m=a_m, d_m=d_m))
        described.append(
            Joint(
                name=f"j{number}",
                type="prismatic" if random.random() < 0.25 else "revolute",
                limits=LIMITS,
                gear_ratio=float(random.uniform(-150, 150)),
                rotor=Rotor(link=int(random.integers(0, number + 1)), axis=tuple(spin.tolist())),
            )
        )
        links.append(
            LinkInertia(
                mass_kg=float(random.uniform(1, 20)),
                centre_m=tuple(random.normal(size=3).tolist()),
                inertia_kg_m2=(xx, yy, zz, xy, xz, yz),
            )
        )
        axes.append(
            SimulatedAxis(
                rotor_inertia_kg_m2=float(random.uniform(1e-4, 1e-3)),
                coulomb_nm=0.0,
                viscous_nm_s=0.0,
                velocity_gain_nm_s=1.0,
                velocity_integral_time_s=1.0,
                rated_motor_torque_nm=1.0,
                peak_motor_torque_nm=3.0,
                encoder_increments_per_motor_rev=1000,
                brake_torque_nm=1.0,
            )
        )
    robot = RobotDescription(
        name="arm",
        kinematics=Kinematics(convention="modified_dh", rows=tuple(rows)),
        joints=tuple(described),
    )
    return robot, PlantConfig(name="arm", links=tuple(links), axes=tuple(axes))


def without_rotors(
    robot: RobotDescription, plant: PlantConfig
) -> tuple[RobotDescription, PlantConfig]:
    joints = tuple(joint.model_copy(update={"rotor": None}) for joint in robot.joints)
    axes = tuple(axis.model_copy(update={"rotor_inertia_kg_m2": 0.0}) for axis in plant.axes)
    return robot.model_copy(update={"joints": joints}), plant.model_copy(update={"axes": axes})


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000), joints=st.integers(1, 7))
def test_a_rotor_adds_the_kinetic_energy_of_its_spin(seed: int, joints: int) -> None:
    """A rotor about axis e with gear ratio mu has the energy ½ I (e·ω + mu q̇)².

    ω is the angular velocity of the link that carries the rotor. This can be the link that the
    rotor moves.
    """
    robot, plant = random_arm(seed, joints)
    bodies = build_rigid_bodies(robot, plant)
    coupling = bodies.gearing
    bare = build_rigid_bodies(*without_rotors(robot, plant))
    random = np.random.default_rng(seed + 1)
    position = random.normal(size=joints)
    full = pin.crba(bodies.model, bodies.model.createData(), coupling @ position)
    data = bare.model.createData()
    expected = np.array(pin.crba(bare.model, data, position))
    pin.computeJointJacobians(bare.model, data, position)
    for i, (joint, axis) in enumerate(zip(robot.joints, plant.axes, strict=True)):
        assert joint.rotor is not None
        spin = joint.gear_ratio * np.eye(joints)[i]
        if joint.rotor.link > 0:
            turning = pin.getJointJacobian(
                bare.model, data, joint.rotor.link, pin.ReferenceFrame.LOCAL
            )[3:]
            spin = spin + np.array(joint.rotor.axis) @ turning
        expected += axis.rotor_inertia_kg_m2 * np.outer(spin, spin)
    np.testing.assert_allclose(coupling.T @ full @ coupling, expected, rtol=1e-11, atol=1e-11)


@settings(max_examples=20)
@given(seed=st.integers(0, 10_000), joints=st.integers(1, 7))
def test_mass_matrix_and_bias_agree_with_inverse_dynamics(seed: int, joints: int) -> None:
    """Pinocchio's mass matrix is silently wrong if the joints of a subtree are not contiguous."""
    bodies = build_rigid_bodies(*random_arm(seed, joints))
    coupling = bodies.gearing
    data = bodies.model.createData()
    random = np.random.default_rng(seed + 2)
    q, v, a = (coupling @ row for row in random.normal(size=(3, joints)))
    inverse = np.array(pin.rnea(bodies.model, data, q, v, a))
    forward = pin.crba(bodies.model, data, q) @ a + pin.nonLinearEffects(bodies.model, data, q, v)
    np.testing.assert_allclose(forward, inverse, rtol=1e-10, atol=1e-10 * abs(inverse).max())


def test_an_armature_acts_on_its_own_joint_only_and_not_on_the_base() -> None:
    robot, plant = random_arm(seed=1, joints=3)
    bare = tuple(joint.model_copy(update={"rotor": None}) for joint in robot.joints)
    axes = tuple(axis.model_copy(update={"rotor_inertia_kg_m2": 0.0}) for axis in plant.axes)
    still = plant.model_copy(update={"axes": axes})
    without = build_rigid_bodies(robot.model_copy(update={"joints": bare}), still)
    plain = tuple(joint.model_copy(update={"armature": True}) for joint in bare)
    armed = robot.model_copy(update={"joints": plain})
    bodies = build_rigid_bodies(armed, plant)
    q, v, a = np.random.default_rng(2).normal(size=(3, 3))
    masses = [
        each.gearing.T
        @ pin.crba(each.model, each.model.createData(), each.gearing @ q)
        @ each.gearing
        for each in (bodies, without)
    ]
    added = [
        joint.gear_ratio**2 * axis.rotor_inertia_kg_m2
        for joint, axis in zip(robot.joints, plant.axes, strict=True)
    ]
    np.testing.assert_allclose(masses[0] - masses[1], np.diag(added), atol=1e-9)
    motion = np.array([q, v, a])
    expected = BaseWrench(armed, still)(motion)
    np.testing.assert_allclose(BaseWrench(armed, plant)(motion), expected, atol=1e-9)


def test_the_bundled_arm_has_the_rotor_terms_of_appendix_d() -> None:
    """Compare with (D.27)-(D.29); motors 2 (sign +) and 3 (sign -) are both mounted on link 2."""
    cell = load_cell("ir361")
    assert cell.plant is not None
    plant = cell.plant.without_unmodelled()
    bodies = build_rigid_bodies(cell.robot, plant)
    coupling = bodies.gearing
    bare = build_rigid_bodies(*without_rotors(cell.robot, plant))
    position = np.array([0.3, -0.7, 1.1])
    with_rotors = pin.crba(bodies.model, bodies.model.createData(), coupling @ position)
    added = coupling.T @ with_rotors @ coupling - pin.crba(
        bare.model, bare.model.createData(), position
    )
    one, two, three = (axis.rotor_inertia_kg_m2 for axis in plant.axes)
    mu1, mu2, mu3 = (joint.gear_ratio for joint in cell.robot.joints)
    expected = [
        [one * mu1**2, 0.0, 0.0],
        [0.0, two * (1 + mu2) ** 2 + three, -three * mu3],
        [0.0, -three * mu3, three * mu3**2],
    ]
    np.testing.assert_allclose(added, expected, atol=1e-12)


def test_the_bundled_upper_arm_is_upright_at_zero_and_its_gravity_is_a_sine() -> None:
    cell = load_cell("ir361")
    assert cell.plant is not None
    plant = cell.plant.without_unmodelled()
    on_the_arm = plant.links[1].model_copy(update={"centre_m": (0.2, 0.0, 0.05)})
    at_the_elbow = plant.links[2].model_copy(update={"centre_m": (0.0, 0.0, 0.0)})
    plant = plant.model_copy(update={"links": (plant.links[0], on_the_arm, at_the_elbow)})
    bodies = build_rigid_bodies(*without_rotors(cell.robot, plant))
    data = bodies.model.createData()
    for angle in (-1.3, -0.4, 0.0, 0.9):
        torque = pin.computeGeneralizedGravity(bodies.model, data, np.array([0.4, angle, 0.7]))
        moment = 9.81 * (on_the_arm.mass_kg * 0.2 + at_the_elbow.mass_kg * 0.480)
        np.testing.assert_allclose(torque, [0.0, -moment * np.sin(angle), 0.0], atol=1e-10)


def test_the_bundled_spring_roughly_balances_the_arm() -> None:
    cell = load_cell("ir361")
    plant, spring = cell.plant, cell.robot.spring
    assert plant is not None
    assert plant.spring is not None
    assert spring is not None
    assert spring.l_m is not None
    assert spring.r_m is not None
    bodies = build_rigid_bodies(cell.robot, plant)
    data = bodies.model.createData()
    for angle in (-1.2, -0.8, 0.6):
        position = bodies.gearing @ np.array([0.0, angle, -angle - 1.5])  # the forearm hangs down
        gravity = pin.computeGeneralizedGravity(bodies.model, data, position)
        torque = (bodies.gearing.T @ gravity)[1]
        length = np.sqrt(
            spring.l_m**2 + spring.r_m**2 - 2 * spring.l_m * spring.r_m * np.cos(angle)
        )
        force = plant.spring.stiffness_n_per_m * (length - plant.spring.free_length_m)
        balanced = torque + force * spring.l_m * spring.r_m * np.sin(angle) / length
        assert abs(balanced) < 0.3 * abs(torque)


@pytest.mark.parametrize(
    ("change", "details"),
    [
        ({"links": ()}, ("links", "0 entries", "3 joints")),
        ({"axes": ()}, ("axes", "0 entries", "3 joints")),
        ({"spring": None}, ("`spring`",)),
    ],
)
def test_a_plant_file_that_does_not_match_its_robot_is_refused(
    change: dict[str, object], details: tuple[str, ...]
) -> None:
    cell = load_cell("ir361")
    assert cell.plant is not None
    with raises_code(ConfigError, "RID-PLANT-UNFIT", "'ir361'", *details):
        build_rigid_bodies(cell.robot, cell.plant.model_copy(update=change))


def test_a_rotor_inertia_without_a_position_of_the_rotor_is_refused() -> None:
    cell = load_cell("ir361")
    assert cell.plant is not None
    joints = (cell.robot.joints[0].model_copy(update={"rotor": None}), *cell.robot.joints[1:])
    with raises_code(ConfigError, "RID-PLANT-UNFIT", "'axis1'"):
        build_rigid_bodies(cell.robot.model_copy(update={"joints": joints}), cell.plant)
