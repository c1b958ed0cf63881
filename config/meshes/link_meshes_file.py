"""Binary file with the meshes of a robot's links, for drawings.

The file begins with a line that names its format. Then follow, little-endian: the number of links
(uint32); for each link the numbers of its vertices and triangles (uint32); for each link its
vertices (three float32, in the frame of the link [m]) and its triangles (three uint32).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from config.errors import ConfigError
from config.meshes.mesh import Mesh

CODE: Final = "RID-ROBOT-MESHES"
MOST_BYTES: Final = 8_000_000
_HEAD: Final = b"rid-daq link meshes 1\n"
_NUMBER: Final = np.dtype("<u4")
_PLACE: Final = np.dtype("<f4")


def pack_link_meshes(links: Sequence[Mesh]) -> bytes:
    """Return the file of some links, base first."""
    sizes = [(len(mesh.vertices_m), len(mesh.triangles)) for mesh in links]
    parts = [_HEAD, np.array([len(links), *sum(sizes, ())], _NUMBER).tobytes()]
    for mesh in links:
        parts.append(mesh.vertices_m.astype(_PLACE).tobytes())
        parts.append(mesh.triangles.astype(_NUMBER).tobytes())
    return b"".join(parts)


def unpack_link_meshes(content: bytes, name: str) -> tuple[Mesh, ...]:
    """Return the meshes of a file, base first.

    Args:
        content: The bytes of the file.
        name: Name of the file in messages.

    Raises:
        ConfigError: The bytes are not such a file, or a number in them is impossible.
    """
    if not content.startswith(_HEAD):
        raise ConfigError(f"{name} is not a file with link meshes", code=CODE)
    reader = _Reader(content, len(_HEAD), name)
    (count,) = reader.take(_NUMBER, 1).tolist()
    sizes = reader.take(_NUMBER, 2 * count).reshape(-1, 2).tolist()
    links = []
    for vertices, triangles in sizes:
        places = reader.take(_PLACE, 3 * vertices).reshape(-1, 3).astype(np.float64)
        corners = reader.take(_NUMBER, 3 * triangles).reshape(-1, 3).astype(np.int64)
        if not np.isfinite(places).all() or (corners.size and corners.max() >= vertices):
            raise ConfigError(
                f"{name}: a vertex is not finite, or a triangle names a missing vertex", code=CODE
            )
        links.append(Mesh(places, corners))
    reader.require_end()
    return tuple(links)


class _Reader:
    """Reader of numbers from bytes."""

    def __init__(self, content: bytes, start: int, name: str) -> None:
        self._content, self._at, self._name = content, start, name

    def take(self, kind: np.dtype[np.generic], count: int) -> np.ndarray:
        end = self._at + count * kind.itemsize
        if end > len(self._content):
            raise ConfigError(
                f"{self._name}: ends after {len(self._content)} bytes, before byte {end}", code=CODE
            )
        taken = np.frombuffer(self._content[self._at : end], kind)
        self._at = end
        return taken

    def require_end(self) -> None:
        if self._at != len(self._content):
            raise ConfigError(
                f"{self._name}: has {len(self._content) - self._at} bytes too many", code=CODE
            )
