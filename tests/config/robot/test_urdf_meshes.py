"""Meshes of a URDF's links, in the frames of the links, compared with Pinocchio's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from config.formats.urdf import UrdfTree
from config.formats.urdf_file import read_urdf
from config.meshes.package_folders import PackageFolders
from config.robot.urdf_meshes import read_link_meshes
from tests.builders.mesh_files import binary_stl, box, dae, obj, write

BRICK = box((0.0, -0.1, 0.2), (0.3, 0.1, 0.5))
LIMIT = '<limit lower="-2" upper="2" effort="50" velocity="2"/>'
URDF = f"""
<robot name="arm">
<link name="base"><collision><origin xyz="0 0 0.1" rpy="0.3 -0.2 0.7"/><geometry>
  <mesh filename="package://arm/meshes/brick.stl" scale="2 -1 0.5"/></geometry></collision>
  <visual><geometry><mesh filename="package://arm/meshes/brick.dae"/></geometry></visual></link>
<link name="upper"><visual><origin xyz="0.1 0 0"/><geometry>
  <mesh filename="../meshes/brick.obj"/></geometry></visual></link>
<link name="fore"><collision><geometry>
  <mesh filename="package://arm/meshes/absent.stl"/></geometry></collision><collision><geometry>
  <mesh filename="package://arm/meshes/brick.stl" scale="1000 1000 1000"/></geometry></collision>
  <visual><geometry><mesh filename="package://arm/meshes/brick.dae"/></geometry></visual></link>
<joint name="lift" type="revolute"><parent link="base"/><child link="upper"/>
  <origin xyz="0 0.1 0.5" rpy="1.57079632679 0 0"/><axis xyz="0 0 1"/>{LIMIT}</joint>
<joint name="bend" type="revolute"><parent link="upper"/><child link="fore"/>
  <origin xyz="0.4 0 0"/><axis xyz="0 0 1"/>{LIMIT}</joint></robot>"""


@pytest.fixture(scope="module")
def urdf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("packages") / "arm"
    write(folder / "meshes/brick.stl", binary_stl(*BRICK))
    write(folder / "meshes/brick.obj", obj(*BRICK))
    millimetres = (1000.0 * BRICK[0], BRICK[1])
    write(folder / "meshes/brick.dae", dae(*millimetres, asset='<unit meter="0.001"/>'))
    return write(folder / "urdf/arm.urdf", URDF)


@pytest.fixture(scope="module")
def tree(urdf: Path) -> UrdfTree:
    return read_urdf(urdf.read_bytes(), "arm.urdf", literal_angles=True)


def test_collision_meshes_are_placed_and_scaled_as_in_pinocchio(urdf: Path, tree: UrdfTree) -> None:
    found = read_link_meshes(tree, PackageFolders(urdf), 1.0).by_link["base"][0].mesh
    model = pin.buildModelFromXML(URDF)
    whole = write(urdf.parent / "whole.urdf", URDF.replace("absent", "brick"))
    shapes = pin.buildGeomFromUrdf(
        model, str(whole), pin.COLLISION, package_dirs=[str(urdf.parents[2])]
    )
    judge = next(each for each in shapes.geometryObjects if each.name == "base_0")
    corners = np.array(judge.geometry.vertices())  # its loader has already applied the scale
    expected = corners @ judge.placement.rotation.T + judge.placement.translation
    order = np.lexsort(np.round(expected, 6).T)
    mine = np.lexsort(np.round(found.vertices_m, 6).T)
    np.testing.assert_allclose(found.vertices_m[mine], expected[order], atol=1e-6)


def test_visual_meshes_count_as_solid_only_without_collision(urdf: Path, tree: UrdfTree) -> None:
    found = read_link_meshes(tree, PackageFolders(urdf), 1.0)
    assert [each.file.name for each in found.by_link["upper"]] == ["brick.obj"]
    np.testing.assert_allclose(
        found.by_link["upper"][0].mesh.vertices_m.min(axis=0), (0.1, -0.1, 0.2), atol=1e-6
    )
    shown = read_link_meshes(tree, PackageFolders(urdf), 1.0, purpose="visual")
    assert [each.file.name for each in shown.by_link["base"]] == ["brick.dae"]
    np.testing.assert_allclose(
        shown.by_link["fore"][0].mesh.vertices_m.max(axis=0), (0.3, 0.1, 0.5), atol=1e-6
    )


def test_missing_meshes_and_wrong_units_are_reported_by_link(urdf: Path, tree: UrdfTree) -> None:
    found = read_link_meshes(tree, PackageFolders(urdf), 1.0)
    assert "fore" not in found.by_link
    missing, large = found.refused["fore"]
    assert missing.address == "package://arm/meshes/absent.stl"
    assert "meshes/absent.stl" in missing.reason
    assert "300" in large.reason
    assert "arm.urdf:10" in large.reason
    small = read_link_meshes(tree, PackageFolders(urdf), 1000.0, links=["upper"])
    assert "0.3" in small.refused["upper"][0].reason
