"""Bodies that are made from the meshes of a URDF are compared with the meshes in Pinocchio."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from config.formats.urdf_file import read_urdf
from config.meshes.package_folders import PackageFolders
from config.robot.urdf_robot import UrdfRobot, robot_of_urdf
from dynamics.geometry.clearances import Clearances
from tests.builders.mesh_files import ascii_stl, binary_stl, box, dae, joined, obj, write

LIMIT = '<limit lower="-3" upper="3" effort="50" velocity="2"/>'


def link(name: str, mesh: str = "", tag: str = "collision", origin: str = "") -> str:
    held = f"<{tag}>{origin}<geometry>{mesh}</geometry></{tag}>" if mesh else ""
    return f'<link name="{name}">{held}</link>'


def mesh(file: str, scale: str = "1 1 1") -> str:
    return f'<mesh filename="package://arm/meshes/{file}" scale="{scale}"/>'


def joint(parent: str, child: str, xyz: str, axis: str) -> str:
    return (
        f'<joint name="to_{child}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="0.1 0.2 0"/><axis xyz="{axis}"/>{LIMIT}</joint>'
    )


ORIGIN = '<origin xyz="0.02 0 0.01" rpy="0 0.3 0.1"/>'
PARTS = (
    link("base", mesh("block.stl")),
    link("upper", mesh("block.obj", "0.5 0.5 2"), "visual"),
    link("fore", mesh("bent.dae"), origin=ORIGIN),
    link("hand", mesh("block.stl", "-0.4 0.4 0.4")),
    joint("base", "upper", "0 0 0.3", "0 0 1"),
    joint("upper", "fore", "0.05 0 0.5", "0 2 0"),
    joint("fore", "hand", "0.4 0.05 0", "1 1 0"),
)
URDF = f'<robot name="arm">{"".join(PARTS)}</robot>'


@pytest.fixture(scope="module")
def urdf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bodies") / "arm"
    block = box((-0.1, -0.1, 0.0), (0.1, 0.1, 0.2))
    bent = joined(
        box((0.0, -30.0, 0.0), (400.0, 30.0, 60.0)), box((340.0, 30.0, 0.0), (400.0, 300.0, 60.0))
    )
    write(folder / "meshes/block.stl", binary_stl(*block))
    write(folder / "meshes/block.obj", obj(*block))
    write(folder / "meshes/bent.dae", dae(*bent, asset='<unit meter="0.001"/>'))
    write(folder / "meshes/metres.stl", ascii_stl(bent[0] / 1000.0, bent[1]))
    return write(folder / "arm.urdf", URDF)


@pytest.fixture(scope="module")
def made(urdf: Path) -> UrdfRobot:
    tree = read_urdf(urdf.read_bytes(), "arm.urdf", literal_angles=True)
    return robot_of_urdf(tree, tip="hand", packages=PackageFolders(urdf))


def test_every_link_has_bodies_with_its_name(made: UrdfRobot) -> None:
    names = [(body.link, body.name) for body in made.robot.bodies]
    assert names == [(0, "base"), (1, "upper"), (2, "fore 1"), (2, "fore 2"), (3, "hand")]


def test_bodies_are_closer_than_the_meshes_by_their_radius_at_most(
    made: UrdfRobot, urdf: Path
) -> None:
    # Pinocchio reads STL in metres where ours is a DAE in millimetres, and collision for visual.
    text = URDF.replace("bent.dae", "metres.stl").replace("visual", "collision")
    whole = write(urdf.parent / "whole.urdf", text)
    model = pin.buildModelFromXML(text)
    shapes = pin.buildGeomFromUrdf(
        model, str(whole), pin.COLLISION, package_dirs=[str(urdf.parents[1])]
    )
    pairs = [("base_0", "fore_0"), ("base_0", "hand_0"), ("upper_0", "hand_0")]
    for first, second in pairs:
        shapes.addCollisionPair(
            pin.CollisionPair(shapes.getGeometryId(first), shapes.getGeometryId(second))
        )
    data, of_shapes = model.createData(), shapes.createData()
    clearances = Clearances.of(made.robot)
    radius_m = max(body.radius_m for body in made.robot.bodies if body.kind == "hull")
    apart = 0
    for q in np.random.default_rng(0).uniform(-3, 3, (40, 3)):
        pin.updateGeometryPlacements(model, data, shapes, of_shapes, q)
        pin.computeDistances(shapes, of_shapes)
        distances = dict(zip(clearances.names, clearances.nearest(q[np.newaxis]), strict=True))
        for (first, second), result in zip(pairs, of_shapes.distanceResults, strict=True):
            expected = result.min_distance
            if expected < 0.01:
                continue  # meshes that overlap have no distance
            apart += 1
            found = min(
                distance
                for name, distance in distances.items()
                if f"body {first[:-2]}" in name and f"body {second[:-2]}" in name
            )
            assert expected - 2 * radius_m - 3e-4 <= found <= expected + 1e-5
    assert apart > 60


def test_the_bodies_made_are_listed_with_points_and_radius(made: UrdfRobot) -> None:
    note = next(note for note in made.notes if "convex bodies were made" in note)
    assert "base 1, 8 points, 0.1 mm" in note or "base 1, 8 points, 0.0 mm" in note
    assert "fore 2, " in note
    assert not any("no bodies" in each for each in made.notes)


def test_missing_meshes_are_listed_once_per_reason_with_their_links(urdf: Path) -> None:
    text = URDF.replace("package://arm/meshes/block", "package://absent/block")
    tree = read_urdf(text.encode(), "arm.urdf")
    made = robot_of_urdf(tree, packages=PackageFolders(urdf))
    assert {body.link for body in made.robot.bodies} == {2}
    note = next(note for note in made.notes if note.startswith("no bodies"))
    for part in ("base (package://absent/block.stl)", "upper (", "hand (", "--packages"):
        assert part in note
    bare = next(note for note in made.notes if note.startswith("without bodies"))
    assert "link 1 (upper), link 3 (hand)" in bare


def test_many_meshes_of_one_link_share_few_hulls(urdf: Path) -> None:
    fingers = "".join(
        link(f"finger{k}", mesh("block.stl", "0.2 0.2 0.2"))
        + f'<joint name="at{k}" type="fixed"><parent link="hand"/><child link="finger{k}"/>'
        f'<origin xyz="0 {0.05 * k} 0.1"/></joint>'
        for k in range(6)
    )
    text = f'<robot name="arm">{"".join(PARTS)}{fingers}</robot>'
    tree = read_urdf(text.encode(), "arm.urdf")
    made = robot_of_urdf(tree, tip="hand", packages=PackageFolders(urdf))
    last = [body for body in made.robot.bodies if body.link == 3]
    assert 1 <= len(last) <= 4
    assert all(body.name.startswith("hand") for body in last)
