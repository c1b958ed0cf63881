"""Conversion of a mesh file (STL, DAE or OBJ) to a `Mesh` in metres.

The library coal reads STL and DAE files. It ignores the unit of a DAE file, which is therefore read
here. If a file has several parts in one node, coal connects their triangles wrongly; then
`dae_geometry.py` reads them, or the convex hull of the vertices replaces them. The `<up_axis>` of a
DAE file is ignored on purpose: RViz ignores it, and the files of robots are made for RViz (decision
0073).
"""

from __future__ import annotations

import os
from array import array
from itertools import pairwise
from pathlib import Path
from typing import BinaryIO, Final
from xml.parsers import expat

import coal  # pyright: ignore[reportMissingImports]
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from config.arrays import FloatArray, IntArray
from config.errors import ConfigError
from config.formats.bounded_file import open_file, read_file
from config.formats.number import parse_number
from config.meshes.dae_geometry import triangles_of_dae
from config.meshes.mesh import Mesh

CODE: Final = "RID-URDF-MESH"
FORMATS: Final = (".stl", ".dae", ".obj")
MOST_BYTES: Final = {".stl": 300_000_000, ".obj": 300_000_000, ".dae": 60_000_000}
"""Largest size of a file. Reading needs up to 24 times the size of a DAE file as memory."""
MOST_TRIANGLES: Final = 1_000_000
"""Largest number of triangles, and of vertices of an OBJ file; each needs about 1 kB of memory."""
SAME_BOUNDS: Final = 1e-5
_CHUNK: Final = 1 << 16
_POINTER: Final = b"version https://git-lfs"
_END_OF_FACET: Final = b"endfacet"
_STL_START: Final = 84
_STL_TRIANGLE: Final = 50
"""Bytes of a binary STL file: before the first triangle, and of each triangle."""


def read_mesh(path: Path) -> Mesh:
    """Read a mesh file.

    Args:
        path: A file with the ending stl, dae or obj, in capital or small letters.

    Returns:
        The mesh. DAE files are scaled to metres by their `<unit>`; the numbers of STL and OBJ
        files, which state no unit, are taken as metres. If the triangles of a file with several
        parts cannot be read, the mesh is the convex hull of all its vertices (`Mesh.is_hull`).

    Raises:
        ConfigError: The file does not exist, has another ending, is damaged, is too large, or
            contains no triangle.
    """
    if path.suffix.lower() not in FORMATS:
        raise ConfigError(
            f"{path}: the format {path.suffix or 'without ending'!r} is not read; convert the mesh"
            " to STL",
            code=CODE,
        )
    kind = path.suffix.lower()
    unit_m = 1.0
    try:
        with open_file(path, MOST_BYTES[kind]) as file:
            start = file.read(_STL_START)
            if kind == ".stl":
                _refuse_long(path, _count_stl(file, start))
            elif kind == ".dae":
                file.seek(0)
                unit_m = _unit_of_dae(file, path)
    except OSError as error:
        raise ConfigError(
            f"{path}: cannot be read: {error.strerror}; simplify the mesh if it is too large",
            code=CODE,
        ) from None
    if start.startswith(_POINTER):
        raise ConfigError(
            f"{path}: contains only a pointer of Git LFS; fetch the mesh with `git lfs pull`",
            code=CODE,
        )
    vertices, triangles = _read_obj(path) if kind == ".obj" else _load(path)
    _refuse_long(path, len(triangles))
    if not np.isfinite(vertices).all():
        raise ConfigError(f"{path}: a vertex is not finite; export the mesh again", code=CODE)
    if len(np.unique(triangles)) == len(vertices):
        return Mesh(vertices * unit_m, triangles)
    # coal numbers the vertices of a node's second and further meshes from 0: these triangles are
    # wrong. It never returns vertices without triangles, so that missing numbers reveal the error.
    if kind == ".dae" and (repaired := _read_dae(path, vertices)) is not None:
        return Mesh(repaired.vertices_m * unit_m, repaired.triangles)
    return _hull_of(vertices * unit_m, path)


def _refuse_long(path: Path, triangles: int) -> None:
    if triangles > MOST_TRIANGLES:
        raise ConfigError(
            f"{path}: has {triangles} triangles or vertices, at most {MOST_TRIANGLES} are read:"
            " simplify the mesh",
            code=CODE,
        )


def _count_stl(file: BinaryIO, start: bytes) -> int:
    """Return the number of triangles of an STL file without loading them.

    A text file begins with `solid`, and so do some binary files. A file is binary if its size is
    that of the number of triangles that it states.
    """
    most = max(0, os.fstat(file.fileno()).st_size - _STL_START) // _STL_TRIANGLE
    stated = int.from_bytes(start[-4:], "little")
    if stated == most or not start.lstrip().startswith(b"solid"):
        return min(stated, most)
    count, rest = start.count(_END_OF_FACET), start[1 - len(_END_OF_FACET) :]
    while chunk := file.read(_CHUNK):
        text = rest + chunk
        count += text.count(_END_OF_FACET)
        rest = text[1 - len(_END_OF_FACET) :]
    return count


def _load(path: Path) -> tuple[FloatArray, IntArray]:
    """Return vertices and triangles of an STL or DAE file.

    Raises:
        ConfigError: The file is damaged, or contains no triangle.
    """
    try:
        found = coal.MeshLoader().load(os.fspath(path))
    except (ValueError, RuntimeError):
        raise _incomplete(path) from None
    count = found.num_tris
    numbers = (triangle[k] for triangle in map(found.tri_indices, range(count)) for k in range(3))
    corners = np.fromiter(numbers, dtype=np.int64, count=3 * count)
    vertices = np.array(found.vertices(), dtype=float).reshape(-1, 3)
    return vertices, corners.reshape(-1, 3)


def _read_dae(path: Path, vertices: FloatArray) -> Mesh | None:
    """Return the mesh of a DAE file; None if it cannot be read, or if it differs from `vertices`.

    The bounds of `vertices`, which coal read, must be those of the mesh.
    """
    try:
        corners = triangles_of_dae(read_file(path, MOST_BYTES[".dae"]), str(path)).reshape(-1, 3)
    except (ConfigError, ValueError, LookupError, StopIteration, OSError):
        return None
    bounds = [np.array([each.min(axis=0), each.max(axis=0)]) for each in (corners, vertices)]
    if np.abs(bounds[0] - bounds[1]).max() > SAME_BOUNDS * np.abs(vertices).max():
        return None
    return Mesh(corners, np.arange(len(corners)).reshape(-1, 3))


def _read_obj(path: Path) -> tuple[FloatArray, IntArray]:
    """Return the vertices that faces use, and triangles of an OBJ file; faces become fans.

    Raises:
        ConfigError: A vertex or face cannot be read, there are too many, or there is no face.
    """
    vertices, triangles = array("d"), array("q")
    try:
        with path.open(encoding="utf-8", errors="replace") as lines:
            for line in lines:
                kind, *words = line.split() or [""]
                count = len(vertices) // 3
                if kind == "v" and len(words) >= 3:
                    vertices.extend(float(word) for word in words[:3])
                elif kind == "v":
                    raise _incomplete(path)
                elif kind == "f":
                    stated = [int(word.partition("/")[0]) for word in words]
                    numbers = [k - 1 if k > 0 else count + k for k in stated]
                    if len(numbers) < 3 or not all(0 <= k < count for k in numbers):
                        raise _incomplete(path)
                    for pair in pairwise(numbers[1:]):
                        triangles.extend((numbers[0], *pair))
                _refuse_long(path, max(len(vertices), len(triangles)) // 3)
    except ValueError:
        raise _incomplete(path) from None
    if not triangles:
        raise _incomplete(path)
    found = np.array(vertices).reshape(-1, 3)
    used, renumbered = np.unique(np.array(triangles), return_inverse=True)
    return found[used], renumbered.reshape(-1, 3)


def _incomplete(path: Path) -> ConfigError:
    return ConfigError(
        f"{path}: is not a complete {path.suffix[1:].upper()} file with triangles; export it again",
        code=CODE,
    )


def _hull_of(vertices_m: FloatArray, path: Path) -> Mesh:
    """Return the convex hull of a file's vertices as a mesh.

    Raises:
        ConfigError: The vertices are flat.
    """
    try:
        hull = ConvexHull(vertices_m)
    except QhullError:
        raise ConfigError(
            f"{path}: its flat parts cannot be read; export them as one mesh", code=CODE
        ) from None
    renumbered = np.searchsorted(np.sort(hull.vertices), hull.simplices)
    return Mesh(vertices_m[np.sort(hull.vertices)], renumbered.astype(np.int64), is_hull=True)


def _unit_of_dae(file: BinaryIO, path: Path) -> float:
    """Return the length unit of a DAE file, which its first <asset> states [m]; 1 if none.

    Raises:
        ConfigError: The unit is not a positive number, or the file is not XML.
    """
    stated: list[str] = []
    open_tags: list[str] = []
    over = False

    def start(tag: str, attributes: dict[str, str]) -> None:
        open_tags.append(tag.rpartition(":")[2])
        if not over and open_tags[1:] == ["asset", "unit"] and "meter" in attributes:
            stated.append(attributes["meter"])

    def end(_tag: str) -> None:
        nonlocal over
        over = over or open_tags[1:] == ["asset"]
        open_tags.pop()

    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = start, end
    try:
        while not over and (chunk := file.read(_CHUNK)):
            parser.Parse(chunk)
    except expat.ExpatError as error:
        raise ConfigError(
            f"{path}:{error.lineno}: not XML: {expat.ErrorString(error.code)}; export the mesh"
            " again",
            code=CODE,
        ) from None
    except (LookupError, ValueError) as error:
        raise ConfigError(
            f"{path}: its encoding is not supported ({error}): save it in UTF-8", code=CODE
        ) from None
    if not stated:
        return 1.0
    try:
        unit_m = parse_number(stated[0])
    except ConfigError:
        unit_m = 0.0
    if not 0.0 < unit_m < float("inf"):
        raise ConfigError(
            f"{path}: the unit is {stated[0]!r} m; correct <unit meter> in <asset>", code=CODE
        )
    return unit_m
