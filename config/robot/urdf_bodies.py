"""Conversion of a URDF's collision shapes to bodies of the robot; meshes are not read."""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.formats.urdf import UrdfPrimitive, UrdfTree
from config.robot.axis_lines import AxisPoses
from config.robot.bodies import Body, Capsule, Hull, Point

CYLINDER_CORNERS: Final = 16
LONGEST_NAME: Final = 80


def bodies_of_urdf(
    tree: UrdfTree,
    carried: list[list[str]],
    places: dict[str, FloatArray],
    axes: AxisPoses,
) -> tuple[tuple[Body, ...], tuple[str, ...]]:
    """Return the collision primitives in the frames of the links, and notes for the user.

    Args:
        tree: The URDF.
        carried: The URDF's links that move together: with the base, then with each joint.
        places: Pose (4, 4) of each of the URDF's links in the base, with the arm's joints at zero.
        axes: The robot's frames.
    """
    bodies: list[Body] = []
    meshes: list[str] = []
    for number, names in enumerate(carried):
        for name in names:
            link = tree.links[name]
            place = np.linalg.inv(axes.frames[number]) @ places[name]
            bodies += [
                _body(
                    number, _name(name, k, len(link.solid.primitives)), part, place @ part.placement
                )
                for k, part in enumerate(link.solid.primitives, start=1)
            ]
            if link.solid.meshes:
                meshes.append(name)
    if not meshes:
        return tuple(bodies), ()
    return tuple(bodies), (
        f"the collision meshes of {', '.join(meshes)} were not read; add `bodies` to robot.yaml by"
        " hand if collisions matter",
    )


def _name(link: str, number: int, count: int) -> str:
    """Return the name of a body: the link's name, with a number if it has several shapes."""
    return (link if count == 1 else f"{link} {number}")[:LONGEST_NAME]


def _body(link: int, name: str, part: UrdfPrimitive, place: FloatArray) -> Body:
    if part.shape == "sphere":
        centre = _point(place[:3, 3])
        return Capsule(
            kind="capsule",
            link=link,
            name=name,
            start_m=centre,
            end_m=centre,
            radius_m=part.size[0],
        )
    if part.shape == "box":
        x, y, z = (0.5 * side for side in part.size)
        corners = [(sx * x, sy * y, sz * z) for sx in (-1, 1) for sy in (-1, 1) for sz in (-1, 1)]
    else:  # a cylinder: the prism that encloses it
        radius, length = part.size
        angles = 2.0 * np.pi * np.arange(CYLINDER_CORNERS) / CYLINDER_CORNERS
        r = radius / np.cos(np.pi / CYLINDER_CORNERS)
        corners = [
            (r * np.cos(angle), r * np.sin(angle), side * 0.5 * length)
            for side in (-1, 1)
            for angle in angles
        ]
    points = np.array(corners) @ place[:3, :3].T + place[:3, 3]
    return Hull(
        kind="hull", link=link, name=name, points_m=tuple(_point(point) for point in points)
    )


def _point(values: FloatArray) -> Point:
    x, y, z = (without_rounding_errors(value) for value in values.tolist())
    return x, y, z


def without_rounding_errors(value: float) -> float:
    """Return a value without rounding errors: 0 if below 1e-12, else rounded to 1e-15."""
    return 0.0 if abs(value) < 1e-12 else round(value, 15)
