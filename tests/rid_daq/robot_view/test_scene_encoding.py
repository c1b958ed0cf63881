"""The binary of a scene is read back as it was written."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from config.errors import ConfigError
from config.load import load_cell
from config.meshes.mesh import Mesh
from rid_daq.robot_view.scene import RobotScene
from rid_daq.robot_view.scene_encoding import (
    Detail,
    SceneDocument,
    decode_mesh,
    encode_mesh,
    encode_scene,
)
from rid_daq.robot_view.sharp_edges import split_at_edges
from rid_daq.robot_view.solids import cylinder_mesh
from tests.builders.raised_codes import raises_code


@st.composite
def meshes(draw: st.DrawFn) -> Mesh:
    points = draw(
        arrays.arrays(
            np.float32,
            st.tuples(st.integers(1, 30), st.just(3)),
            elements=st.floats(-100.0, 100.0, width=32),
        )
    )
    triangles = draw(
        arrays.arrays(
            np.int64,
            st.tuples(st.integers(0, 30), st.just(3)),
            elements=st.integers(0, len(points) - 1),
        )
    )
    return Mesh(points.astype(np.float64), triangles)


@given(meshes())
def test_a_mesh_is_read_as_it_was_written(mesh: Mesh) -> None:
    binary = encode_mesh(mesh)
    assert len(binary) == 12 * (len(mesh.vertices_m) + len(mesh.triangles))
    again = decode_mesh(binary, len(mesh.vertices_m), len(mesh.triangles))
    assert again.vertices_m.tolist() == mesh.vertices_m.tolist()
    assert again.triangles.tolist() == mesh.triangles.tolist()


@given(meshes())
def test_a_split_at_edges_keeps_every_triangle(mesh: Mesh) -> None:
    split, normals = split_at_edges(mesh)
    assert split.vertices_m[split.triangles].tolist() == mesh.vertices_m[mesh.triangles].tolist()
    assert normals.shape == split.vertices_m.shape
    assert sorted(set(split.triangles.ravel().tolist())) == list(range(len(split.vertices_m)))


@given(meshes(), st.integers(-13, 13).filter(bool))
def test_a_binary_of_another_length_is_refused(mesh: Mesh, change: int) -> None:
    binary = (encode_mesh(mesh) + bytes(13))[
        : 12 * (len(mesh.vertices_m) + len(mesh.triangles)) + change
    ]
    with raises_code(ConfigError, "RID-API-ARGUMENT", str(len(binary))):
        decode_mesh(binary, len(mesh.vertices_m), len(mesh.triangles))


def test_damaged_numbers_are_refused() -> None:
    mesh = Mesh(np.eye(3), np.array([[0, 1, 2]]))
    binary = encode_mesh(mesh)
    for damaged in (
        np.float32(np.nan).tobytes() + binary[4:],
        binary[:-4] + np.uint32(3).tobytes(),
    ):
        with raises_code(ConfigError, "RID-API-ARGUMENT"):
            decode_mesh(damaged, 3, 1)


@pytest.mark.parametrize("detail", ["full", "small"])
@pytest.mark.parametrize("cell", ["kr15", "ir361"])
def test_the_links_of_a_scene_are_found_in_its_binary(cell: str, detail: Detail) -> None:
    loaded = load_cell(cell)
    scene = RobotScene.of(loaded.robot, loaded.config.plate)
    document, binary = encode_scene(scene, "/geometry", detail)
    document = SceneDocument.model_validate_json(document.model_dump_json())
    mesh = decode_mesh(binary, document.vertices, document.triangles)
    assert sum(link.index_count for link in document.links) == 3 * document.triangles
    assert document.triangles <= 10_000
    for link, wanted in zip(document.links, scene.links, strict=True):
        part = mesh.triangles.ravel()[link.first_index :][: link.index_count].reshape(-1, 3)
        corners = mesh.vertices_m[part]
        np.testing.assert_allclose(corners, wanted.vertices_m[wanted.triangles], atol=1e-6)
    assert [joint.origin for joint in document.joints] == [
        tuple(map(tuple, joint.origin.tolist())) for joint in scene.joints
    ]
    assert document.tool == tuple(map(tuple, scene.tool.tolist()))


def test_edges_of_a_cylinder_are_sharp_and_its_side_is_round() -> None:
    split, normals = split_at_edges(cylinder_mesh((0, 0, 0), (0, 0, 2), 1.0, 16))
    assert len(split.vertices_m) == 2 * (16 + 16 + 1)  # for each end: side, edge of the cap, middle
    flat = np.abs(normals[:, 2]) > 0.5
    np.testing.assert_allclose(np.abs(normals[flat, 2]), 1.0)
    np.testing.assert_allclose(normals[~flat, 2], 0.0, atol=1e-12)
    outwards = split.vertices_m[~flat, :2]
    np.testing.assert_allclose(normals[~flat, :2], outwards, atol=0.1)
