"""Mesh files of solids with known dimensions, written without a mesh library."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from config.arrays import FloatArray, IntArray

BOX_FACES = np.array(
    [
        *([0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4]),
        *([2, 3, 7], [2, 7, 6], [1, 2, 6], [1, 6, 5], [0, 4, 7], [0, 7, 3]),
    ]
)


def box(low: Sequence[float], high: Sequence[float]) -> tuple[FloatArray, IntArray]:
    """Return vertices (8, 3) and outward triangles (12, 3) of a box along the axes."""
    (x, y, z), (a, b, c) = low, high
    bottom = [(x, y, z), (a, y, z), (a, b, z), (x, b, z)]
    top = [(x, y, c), (a, y, c), (a, b, c), (x, b, c)]
    return np.array([*bottom, *top], dtype=float), BOX_FACES


def joined(*parts: tuple[FloatArray, IntArray]) -> tuple[FloatArray, IntArray]:
    """Return the vertices and triangles of several shapes as one shape."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    return (
        np.vstack([vertices for vertices, _ in parts]),
        np.vstack([faces + start for (_, faces), start in zip(parts, starts, strict=False)]),
    )


def binary_stl(vertices: FloatArray, faces: IntArray, head: bytes = b"test") -> bytes:
    """Return the bytes of a binary STL file; `head` is the text of its header."""
    facets = [
        struct.pack("<12fH", 0.0, 0.0, 0.0, *vertices[face].ravel().tolist(), 0) for face in faces
    ]
    return head.ljust(80) + struct.pack("<I", len(faces)) + b"".join(facets)


def ascii_stl(vertices: FloatArray, faces: IntArray) -> str:
    facets = [
        "facet normal 0 0 0\nouter loop\n"
        + "".join(f"vertex {x!r} {y!r} {z!r}\n" for x, y, z in vertices[face].tolist())
        + "endloop\nendfacet\n"
        for face in faces
    ]
    return f"solid test\n{''.join(facets)}endsolid test\n"


def obj(vertices: FloatArray, faces: IntArray) -> str:
    corners = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in vertices.tolist())
    return corners + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in faces.tolist())


INSTANCE = '<instance_geometry url="#g"/>'


def dae(
    vertices: FloatArray,
    faces: IntArray,
    *,
    asset: str = "",
    nodes: str = f"<node>{INSTANCE}</node>",
) -> str:
    """Return the text of a DAE file; `nodes` is the content of its scene."""
    numbers = " ".join(map(repr, vertices.ravel().tolist()))
    params = "".join(f'<param name="{axis}" type="float"/>' for axis in "XYZ")
    return (
        '<?xml version="1.0" encoding="utf-8"?>'
        '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">'
        f"<asset>{asset}</asset>"
        '<library_geometries><geometry id="g"><mesh><source id="p">'
        f'<float_array id="a" count="{vertices.size}">{numbers}</float_array>'
        f'<technique_common><accessor source="#a" count="{len(vertices)}" stride="3">{params}'
        "</accessor></technique_common></source>"
        '<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>'
        f'<triangles count="{len(faces)}"><input semantic="VERTEX" source="#v" offset="0"/>'
        f"<p>{' '.join(map(str, faces.ravel().tolist()))}</p></triangles></mesh></geometry>"
        f'</library_geometries><library_visual_scenes><visual_scene id="s">{nodes}</visual_scene>'
        '</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>'
    )


def write(path: Path, content: str | bytes) -> Path:
    """Write a file and the folders above it; return its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path
