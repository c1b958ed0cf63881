"""Joints of a URDF that mimic other joints: the torques are compared with Pinocchio by virtual
work.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from config.errors import ConfigError
from config.formats.urdf_file import read_urdf
from config.robot.robot import RobotDescription
from config.robot.urdf_mimic import box_inside
from config.robot.urdf_robot import UrdfRobot, robot_of_urdf
from dynamics.model.cad import cad_parameters
from dynamics.model.robot_model import RobotModel, torque
from tests.builders.raised_codes import raises_code

OFFSET = 0.3
"""Offset of the mimic joint [rad]."""


def link(name: str, mass_kg: float) -> str:
    inertial = f'<inertial><origin xyz="0.15 0.02 0.01"/><mass value="{mass_kg}"/>'
    inertial += '<inertia ixx="0.06" ixy="0.01" ixz="0" iyy="0.08" iyz="0" izz="0.05"/></inertial>'
    return f'<link name="{name}">{inertial if mass_kg else ""}</link>'


ORIGIN = '<origin xyz="0.0 0 0.1" rpy="0 0 0.2"/>'


def joint(name: str, parent: str, child: str, x: float, axis: str = "0 1 0", more: str = "") -> str:
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{x} 0 0.1" rpy="0 0 0.2"/><axis xyz="{axis}"/>{more}'
        '<limit lower="-1.2" upper="1.4" velocity="2" effort="200"/></joint>'
    )


def palletiser(*, first: bool = True, multiplier: float = -1.0, axis: str = "0 1 0", rod_kg=0.0):
    """Return a palletiser: a forearm whose motor sets its angle against the base.

    A mimic joint cancels the upper arm's motion before the forearm's joint j3 (`first`) or after
    it.
    """
    mimic = f'<mimic joint="j2" multiplier="{multiplier}" offset="{OFFSET}"/>'
    turns = [("rod", axis, mimic), ("j3", "0 1 0", "")]
    (a, *one), (b, *other) = turns if first else turns[::-1]
    parts = [
        *(link("base", 5.0), link("l1", 8.0), link("l2", 9.0), link("between", rod_kg)),
        *(link("l3", 6.0), link("l4", 1.5)),
        joint("j1", "base", "l1", 0.0, "0 0 1"),
        joint("j2", "l1", "l2", 0.1),
        joint(a, "l2", "between", 0.5, *one),
        joint(b, "between", "l3", 0.0, *other)
        .replace("0 0 0.1", "0 0 0")
        .replace("0 0 0.2", "0 0 0"),
        joint("j4", "l3", "l4", 0.4, "1 0 0"),
    ]
    return f'<robot name="palletiser">{"".join(parts)}</robot>'


def made(text: str, **more) -> UrdfRobot:
    return robot_of_urdf(read_urdf(text.encode(), "r.urdf"), **more)


def own_torque(robot: RobotDescription, q, v, a) -> np.ndarray:
    model = RobotModel.from_description(robot, rotors=False, friction=False, spring=False)
    return torque(model, q, v, a, cad_parameters(model, robot)[0])


def independent_torque(text: str, positions: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return Pinocchio's torque at every joint by name; each joint has its own motor.

    Args:
        text: The URDF.
        positions: Position, velocity and acceleration of each joint, (3, samples).
    """
    model = pin.buildModelFromXML(
        text.replace("<mimic", "<!--mimic").replace('"0.3"/>', '"0.3"/-->')
    )
    data = model.createData()
    names = list(model.names)[1:]
    motion = np.array([positions[name] for name in names])
    tau = np.array([pin.rnea(model, data, *motion[:, :, k].T) for k in range(motion.shape[2])])
    return {name: tau[:, j] for j, name in enumerate(names)}


def random_motion(n: int) -> np.ndarray:
    return np.random.default_rng(4).uniform(-1.0, 1.0, (3, n, 4))


@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize(("multiplier", "axis", "sign"), [(-1.0, "0 1 0", 1), (0.7, "0 -1 0", -1)])
def test_the_motor_of_the_mimicked_joint_carries_the_mimic_joints_torque(
    first: bool, multiplier: float, axis: str, sign: int
) -> None:
    text = palletiser(first=first, multiplier=multiplier, axis=axis)
    result = made(text)
    robot = result.robot
    assert robot.joint_names == ("j1", "j2", "j3", "j4")
    assert robot.coupling is not None
    assert robot.coupling[2] == pytest.approx((0.0, sign * multiplier, 1.0, 0.0))
    assert any("'rod' mimics 'j2'" in note for note in result.notes)
    motors = random_motion(5)
    rod = multiplier * motors[:, :, 1]
    rod[0] += OFFSET
    stands = {f"j{i + 1}": motors[:, :, i] for i in range(4)} | {"rod": rod}
    tau = independent_torque(text, stands)
    tau["j2"] = tau["j2"] + multiplier * tau["rod"]
    q, v, a = motors @ np.array(robot.coupling).T
    expected = np.column_stack([tau[name] for name in robot.joint_names])
    np.testing.assert_allclose(own_torque(robot, q, v, a), expected, atol=1e-9)


def test_a_mimic_joint_with_its_own_motor_adds_the_parallelograms_motion() -> None:
    text = palletiser().replace("j3", "free").replace('"rod"', '"j3"')
    text = text.replace('<joint name="free" type="revolute">', '<joint name="free" type="fixed">')
    with raises_code(ConfigError, "RID-URDF-MIMIC", "--parallelogram j3", "'j2'"):
        made(text)
    robot = made(text, parallelograms=["j3"]).robot
    assert robot.coupling is not None
    assert robot.coupling[2] == (0.0, -1.0, 1.0, 0.0)
    assert robot.joints[2].limits.position_max == 1.4
    q, v, a = random_motion(5)
    tau = independent_torque(text, {f"j{i + 1}": np.stack([q, v, a])[:, :, i] for i in range(4)})
    expected = np.column_stack([tau[name] for name in robot.joint_names]) @ robot.coupling
    np.testing.assert_allclose(own_torque(robot, q, v, a), expected, atol=1e-9)
    with raises_code(ConfigError, "RID-URDF-MIMIC", "'j4'", "j3"):
        made(text, parallelograms=["j4"])


def test_coupled_joints_keep_the_urdfs_limits_in_every_pose() -> None:
    robot = made(palletiser()).robot
    limits = [each.limits for each in robot.joints]
    corners = np.array(np.meshgrid(*([x.position_min, x.position_max] for x in limits)))
    motors = np.linalg.solve(np.array(robot.coupling), corners.reshape(4, -1))
    assert motors.min() >= -1.2 - 1e-5
    assert motors.max() <= 1.4 + 1e-5
    assert (limits[0].position_min, limits[3].position_max) == (-1.2, 1.4)


def test_a_joint_of_small_range_leaves_the_rest_of_a_shared_limit_to_the_other() -> None:
    matrix = np.array([[1.0, 0.0], [-1.0, 1.0]])
    low, high = box_inside(matrix, np.array([-0.1, -1.0]), np.array([0.1, 1.0]))
    np.testing.assert_allclose([low, high], [[-0.1, -0.9], [0.1, 0.9]], atol=1e-9)


def test_a_mimic_joint_that_the_model_cannot_contain_is_refused() -> None:
    with raises_code(ConfigError, "RID-URDF-MIMIC", "(2 kg)"):
        made(palletiser(rod_kg=2.0))
    with raises_code(ConfigError, "RID-URDF-MIMIC", "--parallelogram rod"):
        made(palletiser(axis="0 0 1"))
    own = palletiser(multiplier=-1.0).replace('joint="j2"', 'joint="j3"')
    with raises_code(ConfigError, "RID-URDF-MIMIC", "multiplier"):
        made(own)
