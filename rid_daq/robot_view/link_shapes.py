"""Shapes of the links: the bodies of the robot file, or a schematic arm if it has none."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, Literal

import numpy as np

from config.arrays import FloatArray
from config.errors import ConfigError
from config.meshes.link_meshes_file import CODE, unpack_link_meshes
from config.meshes.mesh import Mesh
from config.robot.bodies import Body, Capsule
from config.robot.robot import RobotDescription
from rid_daq.robot_view.solids import (
    capsule_mesh,
    coarse_hull_mesh,
    cylinder_mesh,
    hull_mesh,
    join_meshes,
)

ShapeKind = Literal["meshes", "bodies", "schematic"]
"""Origin of a robot's shape. A schematic shape says nothing about the space that links occupy."""

SMALL_TRIANGLES: Final = 10_000
"""Largest number of triangles of the small level of detail."""

_ROUND: Final = 32
_ROUND_MARGIN: Final = 12
_LEAST_POINTS: Final = 6
_DRUM_LENGTH: Final = 0.09
_DRUM_RADIUS: Final = 0.035
_ROD_RADIUS: Final = 0.022


def stored_meshes(
    robot: RobotDescription, name: str, content: bytes
) -> tuple[list[Mesh], list[Mesh]]:
    """Return the meshes of a robot's links in full detail, and with few triangles.

    Args:
        robot: The robot.
        name: Name of the file in messages.
        content: The bytes of the file.

    Raises:
        ConfigError: The file is damaged, or has another number of links.
    """
    from rid_daq.robot_view.simplified_meshes import simplify_links

    links = list(unpack_link_meshes(content, name))
    if len(links) != len(robot.joints) + 1:
        raise ConfigError(
            f"{name}: has {len(links)} links; robot {robot.name} has {len(robot.joints) + 1} with"
            " its base",
            code=CODE,
        )
    return links, simplify_links(links, SMALL_TRIANGLES)


def body_meshes(robot: RobotDescription) -> tuple[list[Mesh], list[Mesh]]:
    """Return the bodies of each link in its frame: base, link 1, link 2, and so on.

    Returns:
        The bodies in full detail, and with at most `SMALL_TRIANGLES` triangles together. A coarse
        body is never larger than the body. If bodies are so many that each would get fewer than
        twelve triangles, each link becomes one convex hull.
    """
    links: list[list[Mesh]] = [[] for _ in range(len(robot.joints) + 1)]
    for body in robot.bodies:
        links[body.link].append(body_mesh(body))
    full = [join_meshes(bodies) for bodies in links]
    if sum(len(link.triangles) for link in full) <= SMALL_TRIANGLES:
        return full, full
    most_points = SMALL_TRIANGLES // (2 * len(robot.bodies))
    if most_points < _LEAST_POINTS:
        most_points = SMALL_TRIANGLES // (2 * len(links))
        links = [[join_meshes(bodies)] if bodies else [] for bodies in links]
    return full, [
        join_meshes(coarse_hull_mesh(body.vertices_m, most_points) for body in bodies)
        for bodies in links
    ]


def schematic_meshes(ends_m: Sequence[FloatArray], axes: Sequence[FloatArray]) -> list[Mesh]:
    """Return a stick robot: drums on the joint axes and rods between them.

    The sizes have no meaning. They decrease from the base to the tool.

    Args:
        ends_m: For base and each link: the next joint's origin, or the tool, in the link's frame.
        axes: Direction of each joint's axis in the frame of the link that it moves.
    """
    reach = max(sum(float(np.linalg.norm(end)) for end in ends_m), 1e-3)
    links = []
    for number, end in enumerate(ends_m):
        size = (1.0 - 0.6 * number / len(ends_m)) * reach
        parts = []
        if np.linalg.norm(end) > 0.01 * reach:
            parts.append(capsule_mesh(np.zeros(3), end, _ROD_RADIUS * size, _ROUND))
        if number:
            half = 0.5 * _DRUM_LENGTH * size * axes[number - 1]
            parts.append(cylinder_mesh(-half, half, _DRUM_RADIUS * size, _ROUND))
        links.append(join_meshes(parts))
    return links


def body_mesh(body: Body) -> Mesh:
    """Return the surface of a body in the frame of its link."""
    if isinstance(body, Capsule):
        return capsule_mesh(body.start_m, body.end_m, body.radius_m, _ROUND)
    points = np.array(body.points_m)
    if body.radius_m:
        around = capsule_mesh(np.zeros(3), np.zeros(3), body.radius_m, _ROUND_MARGIN).vertices_m
        points = (points[:, np.newaxis] + around).reshape(-1, 3)
    return hull_mesh(points)
