"""A robot from a URDF is drawn with its meshes, placed as by Pinocchio.

A cell whose mesh file is missing, or not the one that the robot file names, is refused.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from acquisition.runs.folder import RunFolder
from config.errors import ConfigError
from config.formats.urdf_file import read_urdf
from config.load import LoadedCell, load_cell
from config.meshes.link_meshes_file import pack_link_meshes
from config.meshes.mesh import Mesh
from config.meshes.package_folders import PackageFolders
from config.robot.bodies import Hull
from config.robot.urdf_robot import UrdfRobot, robot_of_urdf
from dynamics.geometry.clearances import Clearances
from rid_daq.app import run
from rid_daq.blocks.picture import Picture
from rid_daq.report.result import Result
from rid_daq.report_page.run_robot import run_robot_blocks
from rid_daq.robot_view.scene import RobotScene
from rid_daq.robot_view.simplified_meshes import simplify_links
from rid_daq.robot_view.solids import capsule_mesh
from tests.builders.mesh_files import binary_stl, box, write
from tests.builders.raised_codes import raises_code

LIMIT = '<limit lower="-2" upper="2" effort="50" velocity="2"/>'
INERTIA = '<inertia ixx=".1" ixy="0" ixz="0" iyy=".1" iyz="0" izz=".1"/>'
MASS = f'<inertial><mass value="3"/>{INERTIA}</inertial>'
URDF = f"""
<robot name="drawn"><link name="base">
  <visual><origin xyz="0 0 0.1" rpy="0.3 -0.2 0.7"/><geometry>
  <mesh filename="package://drawn/brick.stl" scale="2 -1 0.5"/></geometry></visual></link>
<link name="upper">{MASS}<visual><origin xyz="0.1 0 0"/><geometry>
  <mesh filename="package://drawn/brick.stl"/></geometry></visual></link>
<link name="fore">{MASS}<visual><geometry><sphere radius="0.08"/></geometry></visual>
  <visual><geometry><mesh filename="package://drawn/absent.stl"/></geometry></visual></link>
<joint name="lift" type="revolute"><parent link="base"/><child link="upper"/>
  <origin xyz="0 0.1 0.5" rpy="1.57079632679 0 0"/><axis xyz="0 0 1"/>{LIMIT}</joint>
<joint name="slide" type="prismatic"><parent link="upper"/><child link="fore"/>
  <origin xyz="0.4 0 0" rpy="0.2 0.5 0"/><axis xyz="0 1 0"/>{LIMIT}</joint></robot>"""
BRICK = box((0.0, -0.1, 0.2), (0.3, 0.1, 0.5))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("packages")
    write(folder / "drawn/brick.stl", binary_stl(*BRICK))
    write(folder / "drawn/drawn.urdf", URDF)
    return folder


@pytest.fixture(scope="module")
def cell(folder: Path) -> LoadedCell:
    words = ["init", str(folder / "cell"), "--no-rehearsal", "--urdf"]
    assert run([*words, str(folder / "drawn/drawn.urdf")]) == 0
    return load_cell(str(folder / "cell/cell.yaml"))


def scene_of(cell: LoadedCell) -> RobotScene:
    return RobotScene.of(cell.robot, meshes=cell.meshes)


def sorted_corners(points: np.ndarray) -> np.ndarray:
    rounded = np.unique(np.round(points, 5), axis=0)
    return np.asarray(rounded[np.lexsort(rounded.T)])


def test_meshes_are_placed_as_in_pinocchio(folder: Path, cell: LoadedCell) -> None:
    whole = write(folder / "drawn/whole.urdf", URDF.replace("absent", "brick"))
    model = pin.buildModelFromUrdf(str(whole))
    shapes = pin.buildGeomFromUrdf(model, str(whole), pin.VISUAL, package_dirs=[str(folder)])
    data, places = model.createData(), shapes.createData()
    scene = scene_of(cell)
    offset = np.array(cell.robot.base_offset_m)
    assert scene.shape == "meshes"
    for q in (np.zeros(2), np.array([0.7, -0.3])):
        pin.updateGeometryPlacements(model, data, shapes, places, q)
        frames = scene.placements(q)
        for number, name in ((0, "base_0"), (1, "upper_0")):
            index = shapes.getGeometryId(name)
            judge: Any = shapes.geometryObjects[index].geometry
            wanted = [places.oMg[index].act(np.array(point)) - offset for point in judge.vertices()]
            drawn = scene.links[number].placed(frames[number]).vertices_m
            np.testing.assert_allclose(
                sorted_corners(drawn), sorted_corners(np.array(wanted)), atol=2e-5
            )


def test_primitives_are_drawn_and_missing_meshes_are_named(folder: Path, cell: LoadedCell) -> None:
    ball = scene_of(cell).links[2].vertices_m
    assert np.ptp(ball, axis=0) == pytest.approx(0.16, rel=0.03)
    file = folder / "drawn/drawn.urdf"
    tree = read_urdf(file.read_bytes(), "drawn.urdf")
    made = robot_of_urdf(tree, packages=PackageFolders(file))
    assert any("not drawn" in note and "absent.stl" in note for note in made.notes)


def robot_of(folder: Path, text: str) -> UrdfRobot:
    """Return the robot of a URDF that is stored beside the mesh."""
    file = write(folder / "drawn/changed.urdf", text)
    return robot_of_urdf(read_urdf(file.read_bytes(), file.name), packages=PackageFolders(file))


def test_missing_meshes_are_named_if_no_mesh_was_read(folder: Path) -> None:
    made = robot_of(folder, URDF.replace("brick.stl", "lost.stl"))
    assert made.drawings == ()
    assert any("not drawn" in note and "lost.stl" in note for note in made.notes)


@pytest.mark.parametrize(
    ("shape", "sizes"),
    [
        ('<box size="0.3 0.2 1e-8"/>', (0.3, 0.2, 0.0)),
        ('<cylinder radius="0.2" length="1e-8"/>', (0.4, 0.4, 0.0)),
        ('<cylinder radius="1e-8" length="0.2"/>', (0.2, 0.0, 0.0)),
    ],
)
@pytest.mark.parametrize("purpose", ["visual", "collision"])
def test_a_thin_primitive_is_drawn_with_its_size(
    folder: Path, purpose: str, shape: str, sizes: tuple[float, float, float]
) -> None:
    ball = '<visual><geometry><sphere radius="0.08"/></geometry></visual>'
    thin = f"<{purpose}><geometry>{shape}</geometry></{purpose}>"
    made = robot_of(folder, URDF.replace(ball, thin))
    found = [body for body in made.robot.bodies if body.link == 2]
    if purpose == "visual":
        found = list(made.drawings[2].bodies)
    (body,) = found
    assert isinstance(body, Hull)
    points = np.array(body.points_m) - np.mean(body.points_m, axis=0)
    axes = np.linalg.svd(points, full_matrices=False)[2]
    extents = sorted(np.ptp(points @ axes.T, axis=0), reverse=True)
    np.testing.assert_allclose(extents, sizes, rtol=0.03, atol=1e-5)


def test_init_lists_picture_and_meshes(
    folder: Path, cell: LoadedCell, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cell.meshes == (folder / "cell/robot.meshes").read_bytes()
    assert (folder / "cell/robot.png").read_bytes().startswith(b"\x89PNG")
    words = ["init", str(folder / "cell"), "--json", "--urdf", str(folder / "drawn/drawn.urdf")]
    assert run(words) == 2
    assert "robot.meshes" in capsys.readouterr().err


def test_meshes_never_give_a_clearance(cell: LoadedCell) -> None:
    without = cell.robot.model_copy(update={"meshes": None})
    assert Clearances.of(cell.robot).names == Clearances.of(without).names


@pytest.mark.parametrize("change", ["other bytes", "no file"])
def test_a_cell_whose_meshes_do_not_match_is_refused(
    tmp_path: Path, cell: LoadedCell, change: str
) -> None:
    for name, content in cell.files.items():
        write(tmp_path / name, content)
    if change == "no file":
        (tmp_path / "robot.meshes").unlink()
    else:
        write(tmp_path / "robot.meshes", pack_link_meshes([]))
    with raises_code(ConfigError, "RID-ROBOT-MESHES", str(tmp_path / "robot.meshes")):
        load_cell(str(tmp_path / "cell.yaml"))


def test_meshes_of_another_robot_are_refused(cell: LoadedCell) -> None:
    with raises_code(ConfigError, "RID-ROBOT-MESHES", "robot.meshes", " 1 links", " 3 "):
        RobotScene.of(cell.robot, meshes=pack_link_meshes([Mesh(np.eye(3), np.zeros((0, 3), int))]))


@pytest.mark.parametrize(("kept", "shape"), [(True, "MESHES"), (False, "BODIES")])
def test_a_report_shows_the_meshes_of_its_run(
    tmp_path: Path, cell: LoadedCell, kept: bool, shape: str
) -> None:
    folder = RunFolder.create(tmp_path, "run")
    for name, content in cell.files.items():
        if kept or name != "robot.meshes":
            folder.write(name, content)
    blocks = run_robot_blocks(folder, Result.new("Recording", cell.robot.name))
    (picture,) = (each for each in blocks if isinstance(each, Picture))
    assert shape in picture.caption


@pytest.mark.parametrize("most", [1_000, 10_000])
def test_simplified_meshes_keep_their_size_and_the_budget(most: int) -> None:
    dense = [capsule_mesh((0, 0, 0), (0, 0, length), 0.1, 160) for length in (0.2, 0.5, 1.0)]
    coarse = simplify_links(dense, most)
    assert sum(len(mesh.triangles) for mesh in dense) > 30_000
    assert 0.9 * most < sum(len(mesh.triangles) for mesh in coarse) <= most
    for mesh, wanted in zip(coarse, dense, strict=True):
        np.testing.assert_allclose(
            np.ptp(mesh.vertices_m, axis=0), np.ptp(wanted.vertices_m, axis=0), atol=0.01
        )


def test_very_many_shells_become_a_hull() -> None:
    boxes = [box((k, 0, 0), (k + 0.5, 1, 1)) for k in range(500)]
    vertices = np.vstack([corners for corners, _ in boxes])
    triangles = np.vstack([faces + 8 * k for k, (_, faces) in enumerate(boxes)])
    (mesh,) = simplify_links([Mesh(vertices, triangles)], 200)
    assert 12 <= len(mesh.triangles) <= 200
    assert np.ptp(mesh.vertices_m, axis=0)[0] > 400.0


def test_document_lists_the_new_files(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["init", str(folder / "again"), "--no-rehearsal", "--json", "--urdf"]
    assert run([*words, str(folder / "drawn/drawn.urdf")]) == 0
    assert {"robot.meshes", "robot.png"} < set(json.loads(capsys.readouterr().out)["files"])
