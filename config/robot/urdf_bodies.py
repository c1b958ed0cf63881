"""Conversion of a URDF's collision geometry to bodies of the robot: primitives and meshes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.formats.urdf import UrdfPrimitive, UrdfTree
from config.meshes.convex_pieces import convex_pieces
from config.meshes.enclosing_hull import enclosing_hull
from config.meshes.package_folders import PackageFolders
from config.robot.axis_lines import AxisPoses
from config.robot.bodies import Body, Capsule, Hull, Point
from config.robot.urdf_meshes import LARGEST, LinkMeshes, read_link_meshes

CYLINDER_CORNERS: Final = 16
THINNEST: Final = 1e-5
LONGEST_NAME: Final = 80
MOST_PIECES: Final = 4
MOST_PIECES_OF_BASE: Final = 6
"""Largest number of hulls for the meshes that move with one joint, and for those of the base."""
MOST_POINTS: Final = 48
"""Largest number of points of a hull."""
TOLERANCE: Final = 0.003
TOLERANCE_M: Final = (0.0005, 0.004)
"""Tolerance of a hull, as a fraction of the reach, and its limits."""
LARGEST_OF_BASE: Final = 20.0
"""Limit of the size of a mesh of the base, which can be a whole cell, relative to the reach."""


@dataclass(frozen=True)
class UrdfBodies:
    """Bodies made of a URDF's geometry, and notes for the user."""

    bodies: tuple[Body, ...]
    notes: tuple[str, ...]


@dataclass
class _Notes:
    """Notes on meshes: the bodies made from them, and by reason the meshes that were not read."""

    made: list[str] = field(default_factory=list)
    refused: dict[str, list[str]] = field(default_factory=dict)
    hulls: list[str] = field(default_factory=list)

    def add_refused(self, found: LinkMeshes) -> None:
        """Add the meshes that were not read."""
        for link, meshes in found.refused.items():
            for mesh in meshes:
                self.refused.setdefault(mesh.reason, []).append(f"{link} ({mesh.address})")

    def add_hulls(self, found: LinkMeshes) -> None:
        """Add the files of which only the convex hull is known."""
        self.hulls += [
            f"{link} ({each.file.name})"
            for link, meshes in found.by_link.items()
            for each in meshes
            if each.mesh.is_hull
        ]

    def texts(self) -> Iterator[str]:
        """Yield the notes."""
        if self.made:
            yield (
                "convex bodies were made from meshes (number of hulls and points, largest distance"
                " from a body's surface to the part of the mesh that it encloses):"
                f" {'; '.join(self.made)}"
            )
        if self.hulls:
            yield (
                f"the meshes of {', '.join(self.hulls)} consist of several parts that were not read"
                " separately: their bodies contain the convex hull of all parts. To get smaller"
                " bodies, export each mesh as one part"
            )
        for reason, links in self.refused.items():
            yield f"no bodies from the meshes of {', '.join(links)}: {reason}"


def bodies_of_urdf(
    tree: UrdfTree,
    carried: list[list[str]],
    places: dict[str, FloatArray],
    axes: AxisPoses,
    reach_m: float,
    packages: PackageFolders | None,
) -> UrdfBodies:
    """Return the collision geometry in the frames of the robot's links.

    A link's <visual> is used if it has no <collision>. A mesh is divided into few convex pieces.
    Each piece becomes a hull of few points with a radius, which contains the piece completely. If
    more links with meshes move with one joint than there may be hulls, their meshes are joined.

    Args:
        tree: The URDF.
        carried: The URDF's links that move together: with the base, then with each joint.
        places: Pose (4, 4) of each of the URDF's links in the base, with the arm's joints at zero.
        axes: The robot's frames.
        reach_m: Length of the stretched arm.
        packages: Places of the mesh files; if None, meshes are not read.
    """
    bodies: list[Body] = []
    notes = _Notes()
    for number, names in enumerate(carried):
        poses = {name: np.linalg.inv(axes.frames[number]) @ places[name] for name in names}
        hulls: dict[str, list[Hull]] = {}
        if packages is not None:
            largest = LARGEST if number else LARGEST_OF_BASE
            found = read_link_meshes(tree, packages, reach_m, links=names, largest=largest)
            notes.add_refused(found)
            notes.add_hulls(found)
            hulls = _hulls(number, found, poses, reach_m)
            notes.made += [_describe(name, made) for name, made in hulls.items()]
        for name in names:
            solid = tree.links[name].solid
            made = [
                body_of_primitive(number, "", part, poses[name] @ part.placement)
                for part in solid.primitives
            ]
            bodies += _named(name, [*made, *hulls.get(name, ())])
    unread = [name for names in carried for name in names if tree.links[name].solid.meshes]
    texts = [*notes.texts()]
    if packages is None and unread:
        texts.append(f"the collision meshes of {', '.join(unread)} were not read")
    if bodies and (bare := set(range(1, len(carried))) - {body.link for body in bodies}):
        texts.append(
            f"without bodies: {', '.join(f'link {i} ({carried[i][0]})' for i in sorted(bare))};"
            " collisions of these links are not checked. Add `bodies` to robot.yaml by hand if they"
            " matter"
        )
    return UrdfBodies(tuple(bodies), tuple(texts))


def _hulls(
    number: int, found: LinkMeshes, poses: dict[str, FloatArray], reach_m: float
) -> dict[str, list[Hull]]:
    """Return the hulls of the meshes that move with a joint, by the URDF's link.

    Joined meshes count as those of the first link.
    """
    corners = {
        name: np.concatenate([each.mesh.placed(poses[name]).corners_m for each in meshes])
        for name, meshes in found.by_link.items()
    }
    most = MOST_PIECES if number else MOST_PIECES_OF_BASE
    if len(corners) > most:
        corners = {next(iter(corners)): np.concatenate(list(corners.values()))}
    tolerance_m = float(np.clip(TOLERANCE * reach_m, *TOLERANCE_M))
    hulls: dict[str, list[Hull]] = {}
    for name, triangles in corners.items():
        for piece in convex_pieces(triangles, most // len(corners)):
            made = enclosing_hull(piece, tolerance_m, MOST_POINTS)
            points = tuple(_point(point) for point in made.points_m)
            hulls.setdefault(name, []).append(
                Hull(kind="hull", link=number, points_m=points, radius_m=made.radius_m)
            )
    return hulls


def _describe(name: str, hulls: Sequence[Hull]) -> str:
    points = sum(len(hull.points_m) for hull in hulls)
    radius_mm = 1e3 * max(hull.radius_m for hull in hulls)
    return f"{name} {len(hulls)}, {points} points, {radius_mm:.1f} mm"


def _named(link: str, bodies: Sequence[Body]) -> list[Body]:
    """Return the bodies of a link with their names: the link's name, numbered if several."""
    names = [link] if len(bodies) == 1 else [f"{link} {k}" for k in range(1, len(bodies) + 1)]
    return [
        body.model_copy(update={"name": name[-LONGEST_NAME:]})
        for name, body in zip(names, bodies, strict=True)
    ]


def body_of_primitive(link: int, name: str, part: UrdfPrimitive, place: FloatArray) -> Body:
    """Return the body of a primitive with a pose (4, 4) in the frame of a link.

    A box or cylinder that is thinner than `THINNEST` of its largest size becomes that thick,
    because a body must have a volume.
    """
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
    thinnest = THINNEST * max(part.size)
    if part.shape == "box":
        x, y, z = (0.5 * max(side, thinnest) for side in part.size)
        corners = [(sx * x, sy * y, sz * z) for sx in (-1, 1) for sy in (-1, 1) for sz in (-1, 1)]
    else:  # replace a cylinder by the prism that encloses it
        radius, length = (max(size, thinnest) for size in part.size)
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
