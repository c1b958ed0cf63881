"""`LinkDrawing`: what is drawn of a link of a URDF: the meshes and primitives of its <visual>."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from config.arrays import FloatArray
from config.formats.urdf import UrdfTree
from config.meshes.mesh import Mesh
from config.meshes.package_folders import PackageFolders
from config.robot.axis_lines import AxisPoses
from config.robot.bodies import Body
from config.robot.urdf_bodies import LARGEST_OF_BASE, body_of_primitive
from config.robot.urdf_meshes import LARGEST, read_link_meshes


@dataclass(frozen=True, eq=False)
class LinkDrawing:
    """Meshes and bodies that are drawn for a link, in its frame.

    Attributes:
        meshes: Meshes [m].
        bodies: Primitives, as bodies.
    """

    meshes: tuple[Mesh, ...]
    bodies: tuple[Body, ...]


def drawings_of_urdf(
    tree: UrdfTree,
    carried: list[list[str]],
    places: dict[str, FloatArray],
    axes: AxisPoses,
    reach_m: float,
    packages: PackageFolders,
) -> tuple[tuple[LinkDrawing, ...], list[str]]:
    """Return what is drawn of the base and of each link, and notes for the user.

    A link's <collision> is drawn if it has no <visual>.

    Args:
        tree: The URDF.
        carried: The URDF's links that move together: with the base, then with each joint.
        places: Pose (4, 4) of each of the URDF's links in the base, with the arm's joints at zero.
        axes: The robot's frames.
        reach_m: Length of the stretched arm.
        packages: Places of the mesh files.

    Returns:
        The drawings, base first; empty if no mesh was read. A note names the meshes that were not
        read, even if no mesh was read.
    """
    drawings, refused = [], []
    for number, names in enumerate(carried):
        meshes: list[Mesh] = []
        bodies: list[Body] = []
        largest = LARGEST if number else LARGEST_OF_BASE
        found = read_link_meshes(
            tree, packages, reach_m, links=names, largest=largest, purpose="visual"
        )
        refused += [
            f"{name} ({mesh.address})" for name in names for mesh in found.refused.get(name, ())
        ]
        for name in names:
            pose = np.linalg.inv(axes.frames[number]) @ places[name]
            meshes += [each.mesh.placed(pose) for each in found.by_link.get(name, ())]
            link = tree.links[name]
            shown = link.collision if link.visual.is_empty else link.visual
            bodies += [
                body_of_primitive(number, "", part, pose @ part.placement)
                for part in shown.primitives
            ]
        drawings.append(LinkDrawing(tuple(meshes), tuple(bodies)))
    notes = [f"meshes that are not drawn, because they were not read: {', '.join(refused)}"]
    has_meshes = any(drawing.meshes for drawing in drawings)
    return tuple(drawings) if has_meshes else (), notes if refused else []
