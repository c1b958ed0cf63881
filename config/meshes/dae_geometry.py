"""Triangles of a DAE file (COLLADA 1.4.1, 1.5), for files that coal connects wrongly.

Read are `triangles`, `polylist` and `polygons`, whose faces become fans, and nodes with matrices,
translations, rotations and scales. Unit and up axis are not applied.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from config.arrays import FloatArray, IntArray
from config.formats.number import parse_number
from config.formats.xml_tree import XmlElement, parse_xml

MOST_NODES: Final = 10_000


def triangles_of_dae(data: bytes, name: str) -> FloatArray:
    """Return the corners of all triangles of the scene, (triangles, 3, 3), in the file's unit.

    Args:
        data: The file's bytes.
        name: Name of the file in messages.

    Raises:
        ConfigError: The file is not XML, is too large, or a number in it cannot be read.
        ValueError: A part cannot be read, or is of a kind that is not supported.
        LookupError, StopIteration: A part refers to one that is missing.
    """
    root = parse_xml(data, name)
    named = {each.attributes["id"]: each for each in _descendants(root) if "id" in each.attributes}
    parts: list[FloatArray] = []
    waiting = [
        (named[_target(shown)], np.eye(4))
        for scene in root.all("scene")
        for shown in scene.all("instance_visual_scene")
    ]
    count = 0
    while waiting:
        node, pose = waiting.pop()
        count += 1
        if count > MOST_NODES:
            raise ValueError("too many nodes")
        pose = pose @ _transform(node)
        waiting += [(child, pose) for child in node.all("node")]
        waiting += [(named[_target(each)], pose) for each in node.all("instance_node")]
        for instance in node.all("instance_geometry"):
            for mesh in named[_target(instance)].all("mesh"):
                corners = _corners(mesh, named)
                parts.append(corners @ pose[:3, :3].T + pose[:3, 3])
    if not parts:
        raise ValueError("no geometry")
    return np.concatenate(parts)


def _target(element: XmlElement) -> str:
    """Return the id that an element refers to.

    Raises:
        ValueError: It refers to another file.
    """
    address = element.attributes.get("url") or element.attributes.get("source", "")
    if not address.startswith("#"):
        raise ValueError(f"{element.where}: {address!r} is outside of the file")
    return address[1:]


def _descendants(element: XmlElement) -> Iterator[XmlElement]:
    yield element
    for child in element.children:
        yield from _descendants(child)


def _numbers(element: XmlElement, count: int) -> FloatArray:
    values = np.array([parse_number(word) for word in element.text.split()])
    if len(values) != count:
        raise ValueError(f"{element.where}: {len(values)} numbers instead of {count}")
    return values


def _transform(node: XmlElement) -> FloatArray:
    """Return the pose of a node in its parent, (4, 4): its transforms in the file's order."""
    pose = np.eye(4)
    for part in node.children:
        step = np.eye(4)
        if part.tag == "matrix":
            step = _numbers(part, 16).reshape(4, 4)
        elif part.tag == "translate":
            step[:3, 3] = _numbers(part, 3)
        elif part.tag == "scale":
            step[:3, :3] = np.diag(_numbers(part, 3))
        elif part.tag == "rotate":
            *axis, degrees = _numbers(part, 4).tolist()
            x, y, z = np.array(axis) / np.linalg.norm(axis)
            across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
            angle = np.radians(degrees)
            step[:3, :3] += np.sin(angle) * across + (1.0 - np.cos(angle)) * across @ across
        elif part.tag in ("skew", "lookat"):
            raise ValueError(f"{part.where}: <{part.tag}> is not supported")
        pose = pose @ step
    return pose


def _corners(mesh: XmlElement, named: dict[str, XmlElement]) -> FloatArray:
    """Return the corners of the triangles of a <mesh>, (triangles, 3, 3)."""
    found = [
        _points(named[_target(use)], named)[_fans(part, int(use.attributes.get("offset", "0")))]
        for part in mesh.children
        if part.tag in ("triangles", "polylist", "polygons", "tristrips", "trifans")
        for use in part.all("input")
        if use.attributes.get("semantic") == "VERTEX"
    ]
    return np.concatenate(found) if found else np.zeros((0, 3, 3))


def _points(vertices: XmlElement, named: dict[str, XmlElement]) -> FloatArray:
    """Return the positions of a <vertices> element, (points, 3)."""
    use = next(each for each in vertices.all("input") if each.attributes["semantic"] == "POSITION")
    source = named[_target(use)]
    (accessor,) = (each for each in _descendants(source) if each.tag == "accessor")
    if int(accessor.attributes.get("stride", "1")) != 3 or "offset" in accessor.attributes:
        raise ValueError(f"{accessor.where}: the layout of the positions is not supported")
    words = source.all("float_array")[0].text.split()
    return np.array([float(word) for word in words]).reshape(-1, 3)


def _fans(part: XmlElement, offset: int) -> IntArray:
    """Return the position numbers of the triangles of <triangles>, <polylist> or <polygons>."""
    stride = 1 + max(int(each.attributes.get("offset", "0")) for each in part.all("input"))
    lists = [np.array(each.text.split(), dtype=np.int64)[offset::stride] for each in part.all("p")]
    if part.tag == "triangles":
        return np.concatenate(lists).reshape(-1, 3)
    if part.tag == "polylist":
        counts = np.array(part.all("vcount")[0].text.split(), dtype=np.int64)
        lists = np.split(lists[0], np.cumsum(counts)[:-1])
    elif part.tag != "polygons":
        raise ValueError(f"{part.where}: <{part.tag}> is not supported")
    fans = [(face[0], face[k], face[k + 1]) for face in lists for k in range(1, len(face) - 1)]
    return np.array(fans, dtype=np.int64).reshape(-1, 3)
