"""The scene has the robot's kinematics, checked with Pinocchio, and gravity points down in it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from config.formats.urdf_file import read_urdf
from config.load import load_cell, load_robot
from config.robot.robot import RobotDescription
from config.robot.urdf_robot import robot_of_urdf
from rid_daq.robot_view.scene import RobotScene, upright_rotation

ROBOTS = ("ur10e", "ur10", "kr15", "ir361", "exercise")
G = 9.81
TILTED = b"""<robot name="tilted">
<link name="world"/><link name="base"/><link name="a"/><link name="b"/><link name="c"/>
<link name="tool"/>
<joint name="stand" type="fixed"><parent link="world"/><child link="base"/>
  <origin rpy="0.3 0.2 0.1" xyz="0 0 1"/></joint>
<joint name="turn" type="revolute"><parent link="base"/><child link="a"/>
  <origin rpy="0.4 -0.2 1.1" xyz="0.1 -0.2 0.3"/><axis xyz="0.6 0 0.8"/>
  <limit lower="-2" upper="2" velocity="1" effort="100"/></joint>
<joint name="slide" type="prismatic"><parent link="a"/><child link="b"/>
  <origin rpy="-0.7 0.5 0.2" xyz="0.3 0.1 0"/><axis xyz="0 -1 0"/>
  <limit lower="-0.4" upper="0.5" velocity="1" effort="100"/></joint>
<joint name="wheel" type="continuous"><parent link="b"/><child link="c"/>
  <origin rpy="0 1.2 0" xyz="0 0 0.4"/><axis xyz="0 0 1"/>
  <limit velocity="1" effort="100"/></joint>
<joint name="flange" type="fixed"><parent link="c"/><child link="tool"/>
  <origin rpy="0.1 0.2 0.3" xyz="0 0.1 0.2"/></joint>
</robot>"""


def pinocchio_of(robot: RobotDescription) -> tuple[Any, Any]:
    """Build the robot with Pinocchio from its Denavit-Hartenberg table.

    Returns:
        The model, and the tool frame in its last joint's frame.
    """

    def about(axis: str, angle: float) -> Any:
        return pin.SE3(pin.utils.rotate(axis, angle), np.zeros(3))

    def along(*lengths: float) -> Any:
        return pin.SE3(np.eye(3), np.array(lengths))

    model, before = pin.Model(), pin.SE3.Identity()
    for number, (row, joint) in enumerate(
        zip(robot.kinematics.calibrated_rows, robot.joints, strict=True)
    ):
        if robot.kinematics.convention == "modified_dh":
            before = about("x", row.alpha_rad) * along(row.a_m, 0.0, 0.0)
            before = before * about("y", row.beta_rad)
        place = before * about("z", row.theta_rad) * along(0.0, 0.0, row.d_m)
        kind = pin.JointModelPZ() if joint.type == "prismatic" else pin.JointModelRZ()
        model.addJoint(number, kind, place, joint.name)
        before = along(row.a_m, 0.0, 0.0) * about("x", row.alpha_rad)
    end = before if robot.kinematics.convention == "standard_dh" else pin.SE3.Identity()
    tool = pin.SE3(pin.rpy.rpyToMatrix(*robot.tool_rpy_rad), np.array(robot.tool_offset_m))
    return model, end * tool


def poses(scene: RobotScene, count: int) -> np.ndarray:
    limits = np.array([joint.limits for joint in scene.joints])
    return np.random.default_rng(1).uniform(limits[:, 0], limits[:, 1], (count, len(limits)))


@pytest.mark.parametrize("name", ROBOTS)
def test_the_frames_of_a_robot_file_agree_with_pinocchio(name: str) -> None:
    robot = load_robot(name)
    scene = RobotScene.of(robot)
    model, tool = pinocchio_of(robot)
    data = model.createData()
    for q in poses(scene, 20):
        pin.forwardKinematics(model, data, q)
        wanted = [place.homogeneous for place in data.oMi]
        wanted.append(wanted[-1] @ tool.homogeneous)
        np.testing.assert_allclose(scene.placements(q), wanted, atol=1e-12)


def test_axes_and_tool_of_a_urdf_agree_with_pinocchio() -> None:
    robot = robot_of_urdf(
        read_urdf(TILTED, "tilted.urdf", literal_angles=True), base="base", tip="tool"
    ).robot
    scene = RobotScene.of(robot)
    model = pin.buildModelFromXML(TILTED.decode())
    data, frame = model.createData(), model.getFrameId("tool")
    in_base = model.frames[model.getFrameId("base")].placement.inverse()
    offset = np.array(robot.base_offset_m)  # the first frame's origin in the base link's frame
    assert [joint.kind for joint in scene.joints] == ["revolute", "prismatic", "revolute"]
    for q in poses(scene, 20):
        pin.forwardKinematics(model, data, np.array([*q[:2], np.cos(q[2]), np.sin(q[2])]))
        pin.updateFramePlacements(model, data)
        drawn = scene.placements(q)
        tool = (in_base * data.oMf[frame]).homogeneous
        tool[:3, 3] -= offset
        np.testing.assert_allclose(drawn[-1], tool, atol=1e-12)
        for number, joint in enumerate(scene.joints, start=1):
            screw = np.asarray(model.joints[number].createData().S).ravel()
            place = in_base * data.oMi[number]
            axis = place.rotation @ (screw[:3] if joint.kind == "prismatic" else screw[3:])
            np.testing.assert_allclose(drawn[number, :3, :3] @ joint.axis, axis, atol=1e-12)
            if joint.kind == "revolute":  # the origin may be anywhere on the axis
                difference = drawn[number, :3, 3] - (place.translation - offset)
                np.testing.assert_allclose(np.cross(difference, axis), np.zeros(3), atol=1e-12)
    down = in_base.rotation @ [0.0, 0.0, -G]
    np.testing.assert_allclose(
        scene.upright @ down, np.array([0.0, 0.0, -G]), rtol=1e-3, atol=1e-12
    )


@pytest.mark.parametrize(
    ("gravity", "kept"),
    [
        ((0.0, 0.0, -G), (1.0, 0.0, 0.0)),
        ((0.0, 0.0, G), (1.0, 0.0, 0.0)),
        ((G, 0.0, 0.0), (0.0, 0.0, 1.0)),
        ((-G, 0.0, 0.0), (0.0, 0.0, 1.0)),
        ((0.0, -G, 0.0), (1.0, 0.0, 0.0)),
        ((0.0, 3.0, -9.0), (1.0, 0.0, 0.0)),
        ((5.0, 3.0, -7.0), None),
    ],
)
def test_gravity_points_down_in_the_view(
    gravity: tuple[float, float, float], kept: tuple[float, float, float] | None
) -> None:
    turn = upright_rotation(np.array(gravity))
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(turn) > 0.0
    down = np.array([0.0, 0.0, -float(np.linalg.norm(gravity))])
    np.testing.assert_allclose(turn @ gravity, down, atol=1e-14)
    if kept is not None:
        np.testing.assert_allclose(turn @ kept, [1.0, 0.0, 0.0], atol=1e-15)
    else:
        assert (turn @ [1.0, 0.0, 0.0])[1] == pytest.approx(0.0, abs=1e-15)


def test_a_robot_that_stands_upright_is_not_turned() -> None:
    assert RobotScene.of(load_robot("kr15")).upright.tolist() == np.eye(3).tolist()
    assert upright_rotation(np.zeros(3)).tolist() == np.eye(3).tolist()


@pytest.mark.parametrize(("name", "shape"), [("kr15", "bodies"), ("ir361", "schematic")])
def test_the_origin_of_the_shape_is_named(name: str, shape: str) -> None:
    scene = RobotScene.of(load_robot(name))
    assert scene.shape == shape
    assert len(scene.links) == len(scene.small_links) == len(scene.joints) + 1


def test_plate_and_payload_are_in_the_frames_that_carry_them() -> None:
    cell = load_cell("ir361")
    centre = (0.01, -0.02, 0.15)
    scene = RobotScene.of(cell.robot, cell.config.plate, centre)
    assert cell.config.plate is not None
    assert scene.plate is not None
    assert scene.payload_centre_m is not None
    np.testing.assert_allclose(scene.plate[:3, 3], cell.config.plate.position_m)
    turn = pin.rpy.rpyToMatrix(*cell.config.plate.rotation_rad)
    np.testing.assert_allclose(scene.plate[:3, :3], turn, atol=1e-15)
    flange = np.linalg.inv(scene.tool) @ [*scene.payload_centre_m, 1.0]
    np.testing.assert_allclose(flange[:3], centre, atol=1e-15)


@pytest.mark.parametrize(("count", "corners"), [(40, 300), (1_000, 12)])
def test_a_coarse_shape_is_within_its_budget_and_never_larger(count: int, corners: int) -> None:
    points = np.random.default_rng(2).normal(size=(count, corners, 3))
    points /= np.linalg.norm(points, axis=2, keepdims=True)
    bodies = tuple(
        {"kind": "hull", "link": k % 7, "points_m": tuple(map(tuple, hull.tolist()))}
        for k, hull in enumerate(points)
    )
    robot = load_robot("kr15").model_dump(exclude={"bodies", "may_touch"})
    scene = RobotScene.of(RobotDescription.model_validate(robot | {"bodies": bodies}))
    assert sum(len(link.triangles) for link in scene.links) > 12_000
    assert 1_000 < sum(len(link.triangles) for link in scene.small_links) <= 10_000
    for full, coarse in zip(scene.links, scene.small_links, strict=True):
        assert (coarse.vertices_m.min(axis=0) >= full.vertices_m.min(axis=0)).all()
        assert (coarse.vertices_m.max(axis=0) <= full.vertices_m.max(axis=0)).all()
