"""Mesh files of known solids: STL, DAE and OBJ become triangles in metres."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from config.errors import ConfigError
from config.meshes import mesh_file
from config.meshes.mesh_file import read_mesh
from tests.builders.mesh_files import INSTANCE, ascii_stl, binary_stl, box, dae, joined, obj, write
from tests.builders.raised_codes import raises_code

BRICK = box((0.0, 0.0, 0.0), (1.0, 2.0, 3.0))


def volume_m3(mesh) -> float:
    """Return the volume that outward triangles enclose (divergence theorem)."""
    a, b, c = np.moveaxis(mesh.corners_m, 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("brick.stl", binary_stl(*BRICK)),
        ("BRICK.STL", binary_stl(*BRICK)),
        ("solid.stl", binary_stl(*BRICK, head=b"solid brick")),
        ("text.stl", ascii_stl(*BRICK)),
        ("brick.obj", obj(*BRICK)),
        ("brick.dae", dae(*BRICK)),
        ("brick.DAE", dae(*BRICK)),
    ],
)
def test_the_same_brick_is_read_from_every_format(tmp_path: Path, name: str, content) -> None:
    mesh = read_mesh(write(tmp_path / name, content))
    assert len(mesh.triangles) == 12
    np.testing.assert_allclose(mesh.vertices_m.min(axis=0), (0.0, 0.0, 0.0), atol=1e-6)
    np.testing.assert_allclose(mesh.vertices_m.max(axis=0), (1.0, 2.0, 3.0), atol=1e-6)
    assert volume_m3(mesh) == pytest.approx(6.0)


def test_faces_of_an_obj_may_have_four_corners_and_negative_numbers(tmp_path: Path) -> None:
    corners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 7\n"
    text = f"mtllib none.mtl\n{corners}f -5 -4 -3 -2\nf 1/1 2 5//1\n"
    mesh = read_mesh(write(tmp_path / "quads.obj", text))
    assert len(mesh.triangles) == 3
    assert mesh.size_m == pytest.approx(7.0)


@pytest.mark.parametrize(
    ("asset", "factor"),
    [
        ('<unit meter="0.001" name="millimeter"/>', 1e-3),
        ('<unit name="inch" meter="0.0254"/><up_axis>Z_UP</up_axis>', 0.0254),
        ("<contributor><author>a</author></contributor><unit name='m' meter='1'/>", 1.0),
        ("<up_axis>Y_UP</up_axis>", 1.0),
        ("<up_axis>X_UP</up_axis>", 1.0),
    ],
)
def test_a_dae_file_is_scaled_by_its_unit_and_not_turned_by_its_up_axis(
    tmp_path: Path, asset: str, factor: float
) -> None:
    mesh = read_mesh(write(tmp_path / "brick.dae", dae(*BRICK, asset=asset)))
    expected = factor * np.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(mesh.vertices_m.max(axis=0), expected, rtol=1e-6)
    np.testing.assert_allclose(mesh.vertices_m.min(axis=0), 0.0, atol=1e-6)


def test_the_nodes_of_a_dae_file_place_and_repeat_its_geometry(tmp_path: Path) -> None:
    nodes = (
        "<node><translate>10 0 0</translate><rotate>0 0 1 90</rotate>"
        f"<node><scale>1 1 2</scale>{INSTANCE}</node></node>"
        f"<node><matrix>1 0 0 5 0 1 0 6 0 0 1 7 0 0 0 1</matrix>{INSTANCE}</node>"
    )
    mesh = read_mesh(
        write(tmp_path / "two.dae", dae(*BRICK, asset='<unit meter="0.01"/>', nodes=nodes))
    )
    # turned by 90 degrees about z: (x, y) becomes (-y, x); then moved by 10 in x
    turned = np.array([[8.0, 0.0, 0.0], [10.0, 1.0, 6.0]])
    moved = np.array([[5.0, 6.0, 7.0], [6.0, 8.0, 10.0]])
    expected = 0.01 * np.array([np.minimum(turned[0], moved[0]), np.maximum(turned[1], moved[1])])
    found = np.array([mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)])
    np.testing.assert_allclose(found, expected, atol=1e-7)
    assert volume_m3(mesh) == pytest.approx(1e-6 * (12.0 + 6.0), rel=1e-5)


@pytest.mark.parametrize(
    ("scale", "low", "high"),
    [
        ((0.1, 0.1, 0.1), (0.0, 0.0, 0.0), (0.1, 0.2, 0.3)),
        ((1.0, -1.0, 2.0), (0.0, -2.0, 0.0), (1.0, 0.0, 6.0)),
    ],
)
def test_a_mirrored_mesh_keeps_its_outward_side(tmp_path: Path, scale, low, high) -> None:
    mesh = read_mesh(write(tmp_path / "brick.stl", binary_stl(*BRICK))).scaled(scale)
    np.testing.assert_allclose(mesh.vertices_m.min(axis=0), low, atol=1e-6)
    np.testing.assert_allclose(mesh.vertices_m.max(axis=0), high, atol=1e-6)
    assert volume_m3(mesh) == pytest.approx(6.0 * abs(np.prod(scale)))


@pytest.mark.parametrize(
    ("name", "content", "number"),
    [
        ("missing.stl", None, "missing.stl"),
        ("cut.stl", binary_stl(*BRICK)[:-30], "STL"),
        ("cut_text.stl", ascii_stl(*BRICK)[:-40], "STL"),
        ("empty.stl", b"", "STL"),
        ("none.stl", binary_stl(BRICK[0], BRICK[1][:0]), "STL"),
        ("nan.stl", ascii_stl(*BRICK).replace("3.0", "nan"), "finite"),
        ("pointer.stl", "version https://git-lfs.github.com/spec/v1\nsize 9\n", "git lfs"),
        ("face.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 9\n", "OBJ"),
        ("no.dae", "no XML", "no.dae:1"),
        ("unit.dae", dae(*BRICK, asset='<unit meter="0"/>'), "'0'"),
        ("unit.dae", dae(*BRICK, asset='<unit meter="mm"/>'), "'mm'"),
        ("code.dae", '<?xml version="1.0" encoding="foo"?><COLLADA/>', "foo"),
        ("brick.glb", b"glTF", ".glb"),
    ],
)
def test_a_damaged_mesh_is_refused(tmp_path: Path, name: str, content, number: str) -> None:
    if content is not None:
        write(tmp_path / name, content)
    with raises_code(ConfigError, "RID-URDF-MESH", number):
        read_mesh(tmp_path / name)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("binary.stl", binary_stl(*BRICK)),
        ("solid.stl", binary_stl(*BRICK, head=b"solid brick")),
        ("text.stl", ascii_stl(*BRICK)),
        ("brick.obj", obj(*BRICK)),
    ],
)
def test_a_mesh_with_too_many_triangles_is_refused_before_they_are_loaded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, content
) -> None:
    path = write(tmp_path / name, content)
    monkeypatch.setattr(mesh_file, "MOST_TRIANGLES", 11)
    monkeypatch.setattr(mesh_file, "_load", None)
    with raises_code(ConfigError, "RID-URDF-MESH", "12", "11"):
        read_mesh(path)


def test_a_file_beyond_the_largest_size_is_refused_unread(tmp_path: Path) -> None:
    for name, size in mesh_file.MOST_BYTES.items():
        path = tmp_path / f"large{name}"
        with path.open("wb") as file:
            file.truncate(size + 1)
        with raises_code(ConfigError, "RID-URDF-MESH", "MB", "simplify"):
            read_mesh(path)


def test_an_obj_of_several_materials_keeps_the_triangles_of_each(tmp_path: Path) -> None:
    far = box((10.0, 0.0, 0.0), (11.0, 1.0, 1.0))
    first, second = obj(*BRICK), obj(far[0], far[1] + 8)
    text = f"usemtl a\n{first}usemtl b\n{second}"
    mesh = read_mesh(write(tmp_path / "two.obj", text))
    assert not mesh.is_hull
    assert volume_m3(mesh) == pytest.approx(7.0)
    assert mesh.corners_m[12:].min(axis=(0, 1)) == pytest.approx((10.0, 0.0, 0.0))


def dae_of_two_materials(shape: str) -> str:
    """Return a DAE file in dm with two bricks, 10 dm apart, of two materials in one node."""
    both = joined(BRICK, box((10.0, 0.0, 0.0), (11.0, 2.0, 3.0)))
    turn = f"<node><translate>0 0 5</translate><rotate>0 0 1 90</rotate>{INSTANCE}</node>"
    text = dae(*both, asset='<unit meter="0.1"/>', nodes=turn)
    before, rest = text.split("<triangles", 1)
    after = rest.split("</triangles>", 1)[1]
    use = '<input semantic="VERTEX" source="#v" offset="0"/>'
    counts = f"<vcount>{'3 ' * 12}</vcount>" if shape == "polylist" else ""
    parts = "".join(
        f'<{shape} count="12" material="m{k}">{use}{counts}'
        f"<p>{' '.join(map(str, (BRICK[1] + 8 * k).ravel().tolist()))}</p></{shape}>"
        for k in (0, 1)
    )
    return before + parts + after


@pytest.mark.parametrize("shape", ["triangles", "polylist"])
def test_a_dae_of_several_materials_keeps_the_triangles_of_each(tmp_path: Path, shape: str) -> None:
    mesh = read_mesh(write(tmp_path / "two.dae", dae_of_two_materials(shape)))
    assert not mesh.is_hull
    assert volume_m3(mesh) == pytest.approx(0.012, rel=1e-5)
    np.testing.assert_allclose(mesh.vertices_m.min(axis=0), (-0.2, 0.0, 0.5), atol=1e-6)
    np.testing.assert_allclose(mesh.vertices_m.max(axis=0), (0.0, 1.1, 0.8), atol=1e-6)


def test_a_dae_of_several_materials_that_cannot_be_read_becomes_its_hull(tmp_path: Path) -> None:
    text = dae_of_two_materials("triangles").replace("<COLLADA", "<!DOCTYPE COLLADA><COLLADA")
    mesh = read_mesh(write(tmp_path / "two.dae", text))
    assert mesh.is_hull
    np.testing.assert_allclose(mesh.vertices_m.max(axis=0), (0.0, 1.1, 0.8), atol=1e-6)
