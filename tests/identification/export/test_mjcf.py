"""An exported MJCF, computed by MuJoCo."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest

from config.arrays import FloatArray
from config.load import load_robot
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain, forward
from dynamics.model.robot_model import torque
from identification.export.description import mjcf
from identification.export.model import ExportModel
from tests.identification.export.test_description import (
    motion_of,
    random_robot,
    replace_fields,
    with_bodies,
)

ROBOTS = [
    (0, "R", None),
    (1, "RPR", (3.0, -4.0, 8.43623)),
    (2, "RRRRRR", None),
    (3, "PRRPRRR", None),
]


def with_armatures(robot: RobotDescription) -> ExportModel:
    joints = tuple(replace_fields(each, armature=True, gear_ratio=50.0) for each in robot.joints)
    return with_bodies(robot.model_copy(update={"joints": joints}))


def inverse(built: Any, motion: tuple[FloatArray, ...]) -> FloatArray:
    """Return the torques of MuJoCo, friction included, (samples, joints)."""
    data, torques = mujoco.MjData(built), []
    for data.qpos[:], data.qvel[:], data.qacc[:] in zip(*motion, strict=True):
        mujoco.mj_inverse(built, data)
        torques.append(data.qfrc_inverse.copy())
    return np.array(torques)


@pytest.mark.parametrize(("seed", "kinds", "gravity"), ROBOTS)
def test_mujoco_computes_the_torques_of_the_model_with_friction(seed, kinds, gravity) -> None:
    model = with_armatures(random_robot(seed, kinds, gravity))
    built = mujoco.MjModel.from_xml_string(mjcf(model))
    built.jnt_limited[:] = 0  # the motion is random
    q, v, a = motion_of(len(kinds))
    v = np.where(np.abs(v) < 0.1, 0.1, v)  # near standstill MuJoCo smooths Coulomb friction
    expected = torque(model.model, q, v, a, model.parameters)
    np.testing.assert_allclose(inverse(built, (q, v, a)), expected, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize(("seed", "kinds", "gravity"), ROBOTS)
def test_the_site_tool_is_the_tool_of_the_robot(seed, kinds, gravity) -> None:
    model = with_armatures(random_robot(seed, kinds, gravity))
    built = mujoco.MjModel.from_xml_string(mjcf(model))
    data, places = mujoco.MjData(built), []
    q = motion_of(len(kinds))[0]
    for data.qpos[:] in q:
        mujoco.mj_kinematics(built, data)
        places.append(data.site("tool").xpos.copy())
    points = forward(Chain.from_description(model.robot), q) + np.array(model.robot.base_offset_m)
    np.testing.assert_allclose(places, points @ model.upright.T, atol=1e-12)


def test_names_limits_and_motors_are_those_of_the_robot() -> None:
    model = with_bodies(load_robot("ur10e"))
    built = mujoco.MjModel.from_xml_string(mjcf(model))
    limits = [joint.limits for joint in model.robot.joints]
    assert [built.joint(j).name for j in range(6)] == list(model.robot.joint_names)
    assert [built.actuator(j).name for j in range(6)] == list(model.robot.joint_names)
    ranges = [[each.position_min, each.position_max] for each in limits]
    np.testing.assert_allclose(built.jnt_range, ranges)
    np.testing.assert_allclose(built.actuator_ctrlrange[:, 1], [each.torque for each in limits])
    assert built.jnt_limited.all()


def test_what_mujoco_cannot_express_is_listed() -> None:
    head = mjcf(with_bodies(load_robot("ir361"))).partition("<mujoco")[0]
    assert "k_spring = " in head
    assert "the effect of the rotor of axis3" in head
    assert "(armature)" not in head
