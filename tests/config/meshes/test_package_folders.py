"""Addresses of mesh files: packages, files, relative paths."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.errors import ConfigError
from config.meshes.package_folders import PackageFolders
from tests.builders.mesh_files import write
from tests.builders.raised_codes import raises_code


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    write(tmp_path / "src/arm_description/meshes/link 1.stl", "x")
    write(tmp_path / "src/arm_description/urdf/arm.urdf", "x")
    write(tmp_path / "src/gripper/meshes/jaw.stl", "x")
    write(tmp_path / "other/deep/er/camera/lens.stl", "x")
    write(tmp_path / "other/renamed/package.xml", "<package><name>tool</name></package>")
    write(tmp_path / "other/renamed/tip.stl", "x")
    write(tmp_path / "ros/share/table/top.stl", "x")
    return tmp_path


@pytest.mark.parametrize(
    ("address", "file"),
    [
        ("package://arm_description/meshes/link 1.stl", "src/arm_description/meshes/link 1.stl"),
        ("package://arm_description/meshes/link%201.stl", "src/arm_description/meshes/link 1.stl"),
        ("package:///arm_description/meshes/link 1.stl", "src/arm_description/meshes/link 1.stl"),
        ("../meshes/link 1.stl", "src/arm_description/meshes/link 1.stl"),
        ("model://gripper/meshes/jaw.stl", "src/gripper/meshes/jaw.stl"),
        ("$(find gripper)/meshes/jaw.stl", "src/gripper/meshes/jaw.stl"),
        ("file://$(find gripper)/meshes/jaw.stl", "src/gripper/meshes/jaw.stl"),
        ("package://camera/lens.stl", "other/deep/er/camera/lens.stl"),
        ("package://tool/tip.stl", "other/renamed/tip.stl"),
        ("package://table/top.stl", "ros/share/table/top.stl"),
        ("package://old_name/meshes/link 1.stl", "src/arm_description/meshes/link 1.stl"),
    ],
)
def test_an_address_leads_to_its_file(tree: Path, address: str, file: str) -> None:
    folders = PackageFolders(
        tree / "src/arm_description/urdf/arm.urdf",
        folders=(tree / "other",),
        installed=(tree / "ros/share",),
    )
    assert folders.locate(address).samefile(tree / file)


def test_an_absolute_file_address_is_used_as_it_is(tree: Path) -> None:
    wanted = tree / "src/gripper/meshes/jaw.stl"
    folders = PackageFolders(tree / "arm.urdf")
    assert folders.locate(f"file://{wanted}") == wanted
    assert folders.locate(str(wanted)) == wanted


def test_a_folder_that_the_user_names_comes_first(tree: Path) -> None:
    write(tree / "newer/gripper/meshes/jaw.stl", "y")
    folders = PackageFolders(tree / "src/arm_description/urdf/arm.urdf", (tree / "newer",))
    found = folders.locate("package://gripper/meshes/jaw.stl")
    assert found == tree / "newer/gripper/meshes/jaw.stl"


@pytest.mark.parametrize(
    ("address", "part"),
    [
        ("package://absent/a.stl", "--packages"),
        ("package://gripper/absent.stl", "gripper/absent.stl"),
        ("absent.stl", "urdf/absent.stl"),
    ],
)
def test_a_missing_file_is_refused_with_the_places_that_were_searched(
    tree: Path, address: str, part: str
) -> None:
    folders = PackageFolders(tree / "src/arm_description/urdf/arm.urdf")
    with raises_code(ConfigError, "RID-URDF-MESH", part):
        folders.locate(address)
