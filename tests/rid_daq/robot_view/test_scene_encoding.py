"""The binary of a scene is read back as it was written."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from config.load import load_cell
from config.meshes.mesh import Mesh
from rid_daq.robot_view.scene import RobotScene
from rid_daq.robot_view.scene_encoding import (
    Detail,
    SceneDocument,
    encode_mesh,
    encode_scene,
)
from rid_daq.robot_view.sharp_edges import split_at_edges
from rid_daq.robot_view.solids import cylinder_mesh


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


def mesh_of(binary: bytes, vertices: int, triangles: int) -> Mesh:
    """Return the mesh of a binary, as the view in the browser reads it."""
    points = np.frombuffer(binary, "<f4", 3 * vertices).reshape(-1, 3)
    indices = np.frombuffer(binary, "<u4", 3 * triangles, 12 * vertices).reshape(-1, 3)
    return Mesh(points.astype(np.float64), indices.astype(np.int64))


@given(meshes())
def test_a_mesh_is_read_as_it_was_written(mesh: Mesh) -> None:
    binary = encode_mesh(mesh)
    assert len(binary) == 12 * (len(mesh.vertices_m) + len(mesh.triangles))
    again = mesh_of(binary, len(mesh.vertices_m), len(mesh.triangles))
    assert again.vertices_m.tolist() == mesh.vertices_m.tolist()
    assert again.triangles.tolist() == mesh.triangles.tolist()


@given(meshes())
def test_a_split_at_edges_keeps_every_triangle(mesh: Mesh) -> None:
    split, normals = split_at_edges(mesh)
    assert split.vertices_m[split.triangles].tolist() == mesh.vertices_m[mesh.triangles].tolist()
    assert normals.shape == split.vertices_m.shape
    assert sorted(set(split.triangles.ravel().tolist())) == list(range(len(split.vertices_m)))


@pytest.mark.parametrize("detail", ["full", "small"])
@pytest.mark.parametrize("cell", ["kr15", "ir361"])
def test_the_links_of_a_scene_are_found_in_its_binary(cell: str, detail: Detail) -> None:
    loaded = load_cell(cell)
    scene = RobotScene.of(loaded.robot, loaded.config.plate)
    document, binary = encode_scene(scene, "/geometry", detail)
    document = SceneDocument.model_validate_json(document.model_dump_json())
    mesh = mesh_of(binary, document.vertices, document.triangles)
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
