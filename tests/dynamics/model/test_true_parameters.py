from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from config.load import load_cell
from config.robot.robot import RobotDescription
from config.simulation.plant import PlantConfig
from dynamics.model.robot_model import RobotModel, torque
from dynamics.model.true_parameters import true_parameters


@pytest.fixture
def robot() -> RobotDescription:
    return load_cell("ir361").robot


@pytest.fixture
def plant() -> PlantConfig:
    plant = load_cell("ir361").plant
    assert plant is not None
    return plant.without_unmodelled()


def test_rigid_bodies_agree_with_pinocchio_built_from_the_plant_file(
    robot: RobotDescription, plant: PlantConfig
) -> None:
    judge = pin.Model()
    judge.gravity.linear = np.array(robot.gravity_m_s2)
    parent = 0
    for row, link, joint in zip(
        robot.kinematics.modified_rows(), plant.links, robot.joints, strict=True
    ):
        ca, sa = np.cos(row.alpha_rad), np.sin(row.alpha_rad)
        ct, st = np.cos(row.theta_rad), np.sin(row.theta_rad)
        twist = np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]])
        turn = np.array([[ct, -st, 0], [st, ct, 0], [0, 0, 1]])
        place = pin.SE3(twist, np.array([row.a_m, 0, 0])) * pin.SE3(turn, np.array([0, 0, row.d_m]))
        parent = judge.addJoint(parent, pin.JointModelRZ(), place, joint.name)
        xx, yy, zz, xy, xz, yz = link.inertia_kg_m2
        body = pin.Inertia(
            link.mass_kg,
            np.array(link.centre_m),
            np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]),
        )
        judge.appendBodyToJoint(parent, body, pin.SE3.Identity())
    still_rotors = plant.model_copy(
        update={
            "axes": tuple(a.model_copy(update={"rotor_inertia_kg_m2": 0.0}) for a in plant.axes)
        }
    )
    model = RobotModel.from_description(robot, rotors=False, friction=False, spring=False)
    theta = true_parameters(model, robot, still_rotors)
    random = np.random.default_rng(1)
    q, v, a = random.normal(size=(3, 20, 3))
    data = judge.createData()
    expected = [pin.rnea(judge, data, q[i], v[i], a[i]) for i in range(20)]
    np.testing.assert_allclose(torque(model, q, v, a, theta), expected, atol=1e-9)


def test_a_rotor_on_link_2_adds_its_polar_inertia_to_the_link(
    robot: RobotDescription, plant: PlantConfig
) -> None:
    model = RobotModel.from_description(robot)
    value = dict(zip(model.parameter_names, true_parameters(model, robot, plant), strict=True))
    link = plant.links[1]
    x, y, _ = link.centre_m
    both = plant.axes[1].rotor_inertia_kg_m2 + plant.axes[2].rotor_inertia_kg_m2
    expected = link.inertia_kg_m2[2] + link.mass_kg * (x**2 + y**2) + both
    assert value["Izz2"] == pytest.approx(expected)
    assert value["Im3"] == plant.axes[2].rotor_inertia_kg_m2
    assert value["P0_spring"] == pytest.approx(7500.0 * 0.25)
    assert value["fc_axis3"] == 9.0


def test_an_armature_is_the_rotors_inertia_times_the_squared_gear_ratio(
    robot: RobotDescription, plant: PlantConfig
) -> None:
    joints = tuple(
        j.model_copy(update={"rotor": None, "armature": True, "gear_ratio": -60.0})
        for j in robot.joints
    )
    model = RobotModel.from_description(armed := robot.model_copy(update={"joints": joints}))
    value = dict(zip(model.parameter_names, true_parameters(model, armed, plant), strict=True))
    assert value["Ia3"] == pytest.approx(60.0**2 * plant.axes[2].rotor_inertia_kg_m2)


def test_friction_terms_missing_in_the_plant_are_zero(
    robot: RobotDescription, plant: PlantConfig
) -> None:
    joints = tuple(j.model_copy(update={"friction": ("offset", "cubic")}) for j in robot.joints)
    model = RobotModel.from_description(robot.model_copy(update={"joints": joints}))
    theta = true_parameters(model, robot, plant)
    groups = model.parameter_groups
    assert not theta[groups["friction"]].any()
