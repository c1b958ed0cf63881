"""`SceneDocument`: a scene as JSON, with its triangles in a binary."""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal

import numpy as np
from pydantic import Strict

from config.arrays import FloatArray
from config.meshes.mesh import Mesh
from config.model import ConfigModel
from rid_daq.robot_view.link_shapes import ShapeKind
from rid_daq.robot_view.scene import RobotScene
from rid_daq.robot_view.sharp_edges import split_at_edges
from rid_daq.robot_view.solids import join_meshes

Detail = Literal["full", "small"]
"""Level of detail; the small level has at most 10,000 triangles."""

Three = Annotated[tuple[float, float, float], Strict(False)]
Four = Annotated[tuple[float, float, float, float], Strict(False)]
Rotation3 = Annotated[tuple[Three, Three, Three], Strict(False)]
Pose4 = Annotated[tuple[Four, Four, Four, Four], Strict(False)]
Pair = Annotated[tuple[float, float], Strict(False)]

_POSITION: Final = np.dtype("<f4")
_INDEX: Final = np.dtype("<u4")


class JointDocument(ConfigModel):
    """A joint, as `SceneJoint`.

    Attributes:
        name: Name of the joint.
        origin: The joint's frame at position 0 in the frame of the previous link; rows of a matrix.
        axis: Axis in the joint's frame.
        kind: Kind of joint.
        limits: Lowest and highest position [rad or m].
    """

    name: str
    origin: Pose4
    axis: Three
    kind: Literal["revolute", "prismatic"]
    limits: Pair


class LinkDocument(ConfigModel):
    """A link and its part of the binary.

    Attributes:
        name: Name of the link.
        first_index, index_count: Its part of the indices; three indices are a triangle.
    """

    name: str
    first_index: int
    index_count: int


class SceneDocument(ConfigModel):
    """A scene without its triangles. Matrices are lists of rows, lengths are in metres.

    The binary contains `vertices` positions of three float32, in the frame of the vertex's link,
    and then three uint32 indices for each of the `triangles`, all little-endian. No vertex belongs
    to two links. Vertices on both sides of a sharp edge are separate.

    Attributes:
        robot: Name of the robot.
        shape: Origin of the shape.
        upright: Rotation from the base frame to the view, in which gravity is along -z.
        gravity: Acceleration of gravity in the base frame [m/s^2].
        joints: The joints, base to flange.
        links: Base and links.
        tool: Tool frame in the frame of the last link.
        plate: Force plate in the base frame.
        payload_centre: Centre of gravity of a payload in the frame of the last link.
        vertices, triangles: Counts of the binary.
        geometry: Address of the binary.
        files_hash: Hash of the cell's files; empty without a cell.
    """

    robot: str
    shape: ShapeKind
    upright: Rotation3
    gravity: Three
    joints: Annotated[tuple[JointDocument, ...], Strict(False)]
    links: Annotated[tuple[LinkDocument, ...], Strict(False)]
    tool: Pose4 | None
    plate: Pose4 | None
    payload_centre: Three | None
    vertices: int
    triangles: int
    geometry: str
    files_hash: str = ""


def encode_scene(scene: RobotScene, geometry: str, detail: Detail) -> tuple[SceneDocument, bytes]:
    """Return a scene's document and binary.

    Args:
        scene: The scene.
        geometry: Address at which the page finds the binary.
        detail: Level of detail.
    """
    parts, links, first = [], [], 0
    for name, mesh in zip(
        scene.link_names, scene.links if detail == "full" else scene.small_links, strict=True
    ):
        parts.append(split_at_edges(mesh)[0])
        count = parts[-1].triangles.size
        links.append(LinkDocument(name=name, first_index=first, index_count=count))
        first += count
    whole = join_meshes(parts)
    document = SceneDocument(
        robot=scene.robot,
        shape=scene.shape,
        upright=_nested(scene.upright),
        gravity=_nested(scene.gravity_m_s2),
        joints=tuple(JointDocument.from_attributes(joint) for joint in scene.joints),
        links=tuple(links),
        tool=_nested(scene.tool),
        plate=None if scene.plate is None else _nested(scene.plate),
        payload_centre=None if scene.payload_centre_m is None else _nested(scene.payload_centre_m),
        vertices=len(whole.vertices_m),
        triangles=len(whole.triangles),
        geometry=geometry,
    )
    return document, encode_mesh(whole)


def encode_mesh(mesh: Mesh) -> bytes:
    """Return positions as float32, then indices as uint32, little-endian."""
    return mesh.vertices_m.astype(_POSITION).tobytes() + mesh.triangles.astype(_INDEX).tobytes()


def _nested(values: FloatArray) -> Any:
    """Return an array as nested tuples."""
    return tuple(_nested(row) if row.ndim else float(row) for row in values)
