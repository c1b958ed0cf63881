"""`still_parts`: the parts and labels of a still picture, for one pose of a scene."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.meshes.mesh import Mesh
from rid_daq.robot_view.scene import RobotScene, SceneJoint
from rid_daq.robot_view.sharp_edges import split_at_edges
from rid_daq.robot_view.solids import (
    arrow_mesh,
    box_mesh,
    capsule_mesh,
    cylinder_mesh,
    join_meshes,
    tube_mesh,
)

LINKS: Final = ((176.0, 188.0, 201.0), (138.0, 155.0, 172.0))
JOINT: Final = (122.0, 63.0, 176.0)
LIMIT: Final = (196.0, 122.0, 18.0)
AXES: Final = ((208.0, 40.0, 30.0), (26.0, 143.0, 60.0), (37.0, 99.0, 201.0))
PLATE: Final = (206.0, 214.0, 222.0)
DARK, BRIGHT = (35.0, 35.0, 35.0), (250.0, 250.0, 250.0)

_LETTERS: Final = "XYZ"
_WHOLE_TURN: Final = 2.0 * np.pi - 1e-6


@dataclass(frozen=True, eq=False)
class DrawnPart:
    """A part of a picture.

    Attributes:
        mesh: Triangles in the view's frame, in which gravity points along -z [m].
        normals: Shape (points, 3). Unit normals of its points.
        colour: Shape (3,). Red, green and blue, 0 to 255.
        in_front: True if the part is visible through the links.
    """

    mesh: Mesh
    normals: FloatArray
    colour: FloatArray
    in_front: bool = False

    @classmethod
    def of(
        cls,
        mesh: Mesh,
        frame: FloatArray,
        colour: tuple[float, float, float],
        *,
        in_front: bool = False,
    ) -> DrawnPart:
        """Return a part with sharp edges.

        Args:
            mesh: Triangles in a frame [m].
            frame: Shape (4, 4). The frame in the view.
            colour: Red, green and blue, 0 to 255.
            in_front: True if the part is visible through the links.
        """
        return cls(*split_at_edges(mesh.placed(frame)), np.array(colour), in_front)


@dataclass(frozen=True, eq=False)
class Label:
    """A text at a place in the picture.

    Attributes:
        text: The text.
        place: Shape (3,). Place in the view's frame [m].
        start: Shape (3,). Start of the arrow whose tip is the place; the label is beyond the tip.
    """

    text: str
    place: FloatArray
    start: FloatArray


@dataclass(frozen=True, eq=False)
class StillParts:
    """Parts and labels of a picture in one pose.

    Attributes:
        parts: The parts.
        labels: The labels, the most important first.
    """

    parts: tuple[DrawnPart, ...]
    labels: tuple[Label, ...]


def still_parts(scene: RobotScene, q: FloatArray) -> StillParts:
    """Return the parts and labels of a robot's picture.

    Args:
        scene: The scene.
        q: Shape (n,). Joint positions [rad or m].
    """
    return _sorted(_made(scene, q))


def flange_parts(scene: RobotScene) -> StillParts:
    """Return the last two links with tool frame and payload, in the tool's frame.

    The last joint is at zero.

    Args:
        scene: The scene.
    """
    return _sorted(_made_at_flange(scene))


def _sorted(made: Iterator[DrawnPart | Label]) -> StillParts:
    found = list(made)
    return StillParts(
        tuple(part for part in found if isinstance(part, DrawnPart)),
        tuple(label for label in found if isinstance(label, Label)),
    )


def size_of(scene: RobotScene) -> float:
    """Return the length from which the sizes of all arrows are computed [m]."""
    ends = [*(joint.origin[:3, 3] for joint in scene.joints), scene.tool[:3, 3]]
    return 0.1 * max(sum(float(np.linalg.norm(end)) for end in ends), 0.05)


def _made(scene: RobotScene, q: FloatArray) -> Iterator[DrawnPart | Label]:
    view = np.eye(4)
    view[:3, :3] = scene.upright
    frames = view @ scene.placements(q)
    size = size_of(scene)
    for number, link in enumerate(scene.links):
        yield DrawnPart.of(link, frames[number], LINKS[number % 2])
    if scene.payload_centre_m is not None:
        yield from _centre(scene.payload_centre_m, frames[-2], size)
    yield from _triad("tool", frames[-1], size)
    for number, joint in enumerate(scene.joints, start=1):
        yield from _axis(number, joint, frames[number], size)
        fixed = frames[number - 1] @ joint.origin
        yield from _limits(joint, fixed, float(q[number - 1]), size)
    yield from _triad("base", frames[0], size)
    if scene.plate is not None:
        yield from _plate(view @ scene.plate, size)


def _made_at_flange(scene: RobotScene) -> Iterator[DrawnPart | Label]:
    last = np.asarray(np.linalg.inv(scene.tool), dtype=np.float64)
    size = 0.45 * size_of(scene)
    frames = (last @ np.linalg.inv(scene.joints[-1].origin), last)
    for number, frame in zip((-2, -1), frames, strict=True):
        link = scene.links[number]
        colour = LINKS[(len(scene.links) + number) % 2]
        yield DrawnPart.of(link, frame, colour)
    if scene.payload_centre_m is not None:
        yield from _centre(scene.payload_centre_m, last, size)
    yield from _triad("flange", np.eye(4), size)
    yield from _axis(len(scene.joints), scene.joints[-1], last, size)


def _triad(name: str, frame: FloatArray, size: float) -> Iterator[DrawnPart | Label]:
    for letter, axis, colour in zip(_LETTERS, np.eye(3), AXES, strict=True):
        arrow = arrow_mesh(np.zeros(3), 1.5 * size * axis, 0.05 * size)
        yield DrawnPart.of(arrow, frame, colour, in_front=True)
        yield Label(f"{name} {letter}", _place(frame, 1.5 * size * axis), frame[:3, 3])


def _axis(
    number: int, joint: SceneJoint, frame: FloatArray, size: float
) -> Iterator[DrawnPart | Label]:
    begin, end = -0.6 * size * joint.axis, 1.9 * size * joint.axis
    arrow = arrow_mesh(begin, end, 0.04 * size)
    yield DrawnPart.of(arrow, frame, JOINT, in_front=True)
    yield Label(f"J{number} +", _place(frame, end), frame[:3, 3])


def _limits(
    joint: SceneJoint, fixed: FloatArray, position: float, size: float
) -> Iterator[DrawnPart]:
    """Yield an arc or a rail between the limits, and the needle of the present position.

    Limits that are a whole turn apart are not drawn: the arc would show nothing.
    """
    low, high = joint.limits
    thin = 0.025 * size
    if joint.kind == "prismatic":
        across = _across(joint.axis)
        ends = [at * joint.axis + 0.5 * size * across for at in (low, high)]
        rail = [cylinder_mesh(ends[0], ends[1], thin, 12)]
        rail += [_tick(end, across, 0.15 * size, thin) for end in ends]
        needle = position * joint.axis
        rail.append(cylinder_mesh(needle, needle + 0.6 * size * across, thin, 12))
    elif high - low < _WHOLE_TURN:
        radius = 0.95 * size
        first = _across(joint.axis)
        second = np.cross(joint.axis, first)

        def towards(angle: float) -> FloatArray:
            return np.asarray(np.cos(angle) * first + np.sin(angle) * second)

        angles = np.linspace(low, high, max(3, int(24.0 * (high - low))))
        rail = [
            tube_mesh(np.array([radius * towards(angle) for angle in angles]), joint.axis, thin)
        ]
        rail += [_tick(radius * towards(at), towards(at), 0.18 * size, thin) for at in (low, high)]
        rail.append(cylinder_mesh(np.zeros(3), 1.1 * radius * towards(position), thin, 12))
    else:
        return
    yield DrawnPart.of(join_meshes(rail), fixed, LIMIT, in_front=True)


def _tick(place: FloatArray, direction: FloatArray, length: float, radius: float) -> Mesh:
    half = 0.5 * length * direction
    return cylinder_mesh(place - half, place + half, 1.6 * radius, 12)


def _across(axis: FloatArray) -> FloatArray:
    """Return the frame's x axis, or y if the joint's axis is x, at a right angle to the axis."""
    x = np.eye(3)[1 if abs(axis[0]) > 0.9 else 0]
    x = x - (x @ axis) * axis
    return np.asarray(x / np.linalg.norm(x))


def _centre(centre_m: FloatArray, frame: FloatArray, size: float) -> Iterator[DrawnPart | Label]:
    """Yield the ball of a payload's centre of gravity, quartered black and white."""
    radius = 0.28 * size
    ball = capsule_mesh(np.zeros(3), np.zeros(3), radius, 32)
    corners = ball.vertices_m[ball.triangles].mean(axis=1)
    dark = np.prod(np.sign(corners), axis=1) > 0.0
    for chosen, colour in ((dark, DARK), (~dark, BRIGHT)):
        part = Mesh(ball.vertices_m + centre_m, ball.triangles[chosen])
        yield DrawnPart.of(part, frame, colour, in_front=True)
    centre = _place(frame, centre_m)
    yield Label("centre of gravity", centre + 1.2 * radius * np.array([0.6, -0.6, 0.8]), centre)


def _plate(frame: FloatArray, size: float) -> Iterator[DrawnPart | Label]:
    """Yield the plate with its axes; its surface is at z = 0, and z points into the plate."""
    half = 2.2 * size
    slab = box_mesh((-half, -half, 0.0), (half, half, 0.3 * size))
    yield DrawnPart.of(slab, frame, PLATE)
    yield from _triad("plate", frame, size)


def _place(frame: FloatArray, point: FloatArray) -> FloatArray:
    return np.asarray(frame[:3, :3] @ point + frame[:3, 3])
