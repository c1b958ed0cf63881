"""The binary file of link meshes: round trip, and refusal of damaged files."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from config.errors import ConfigError
from config.meshes.link_meshes_file import pack_link_meshes, unpack_link_meshes
from config.meshes.mesh import Mesh
from tests.builders.raised_codes import raises_code

CODE = "RID-ROBOT-MESHES"
ONE = [Mesh(np.eye(3), np.array([[0, 1, 2]])), Mesh(np.zeros((0, 3)), np.zeros((0, 3), int))]


@st.composite
def meshes(draw: st.DrawFn) -> Mesh:
    size = st.tuples(st.integers(0, 12), st.just(3))
    places = draw(arrays.arrays(np.float32, size, elements=st.floats(-9.0, 9.0, width=32)))
    numbers = st.integers(0, max(len(places) - 1, 0))
    triangles = draw(arrays.arrays(np.int64, size if len(places) else (0, 3), elements=numbers))
    return Mesh(places.astype(np.float64), triangles)


@given(st.lists(meshes(), max_size=8))
def test_links_are_read_as_they_were_written(links: list[Mesh]) -> None:
    again = unpack_link_meshes(pack_link_meshes(links), "robot.meshes")
    assert len(again) == len(links)
    for mesh, wanted in zip(again, links, strict=True):
        assert mesh.vertices_m.tolist() == wanted.vertices_m.tolist()
        assert mesh.triangles.tolist() == wanted.triangles.tolist()


@given(st.lists(meshes(), min_size=1, max_size=4), st.data())
def test_a_cut_file_is_refused(links: list[Mesh], data: st.DataObject) -> None:
    whole = pack_link_meshes(links)
    length = data.draw(st.integers(0, len(whole) - 1))
    with raises_code(ConfigError, CODE, "robot.meshes"):
        unpack_link_meshes(whole[:length], "robot.meshes")


@pytest.mark.parametrize(
    "damage",
    [
        lambda whole: whole + b"\0",
        lambda whole: b"x" + whole,
        lambda whole: whole[:-4] + np.uint32(3).tobytes(),
        lambda whole: whole[:-48] + np.float32(np.nan).tobytes() + whole[-44:],
        lambda whole: whole[:22] + np.uint32(2**31).tobytes() + whole[26:],
    ],
)
def test_a_damaged_file_is_refused(damage) -> None:
    with raises_code(ConfigError, CODE, "robot.meshes"):
        unpack_link_meshes(damage(pack_link_meshes(ONE)), "robot.meshes")
