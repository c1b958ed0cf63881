"""A URDF file (ROS, "URDF XML specification") to a `UrdfTree`, with everything that is wrong in it.

What cannot be read as a tree of links and joints is refused, all of it at once. What can be read
and is invalid (a limit of infinity, a box of no size, a reduction of 0) is left out and kept
as an oddity of its link, for whoever needs that link.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from typing import Final, TypeVar

import numpy as np

from config.arrays import FloatArray
from config.errors import ConfigError
from config.formats.urdf import (
    MOVING,
    UrdfCollision,
    UrdfInertial,
    UrdfJoint,
    UrdfLink,
    UrdfTree,
    rotation_of_rpy,
)
from config.formats.xml_tree import XmlElement, parse_xml

RIGHT_ANGLE_TOLERANCE_RAD: Final = 1e-5
MOST_JOINTS: Final = 2000
KINDS: Final = (*MOVING, "fixed", "floating", "planar")
_LIMITS: Final = ("lower", "upper", "velocity", "effort")
_LARGEST_RATIO: Final = 1e6

T = TypeVar("T")


def read_urdf(
    data: bytes, file: str, *, right_angle_tolerance_rad: float = RIGHT_ANGLE_TOLERANCE_RAD
) -> UrdfTree:
    """Read a URDF.

    Parameters
    ----------
    data : bytes
        The file's bytes.
    file : str
        What to call it in messages.
    right_angle_tolerance_rad : float
        Angles this close to a whole number of quarter turns are taken as exactly that: files round
        them to 1.5708 and the like, which would make parallel axes nearly parallel.

    Raises
    ------
    ConfigError
        The file is not XML, not a URDF, or has links and joints that cannot be read or make no
        tree; a line a problem.
    """
    root = parse_xml(data, file)
    if root.tag != "robot":
        raise ConfigError(f"{root.where}: the root is <{root.tag}>, a URDF begins with <robot>")
    if _has_xacro(root):
        raise ConfigError(
            f"{file}: this is a xacro file: expand it first (pip install xacro;"
            " xacro FILE > robot.urdf), then give robot.urdf"
        )
    reader = _Reader(right_angle_tolerance_rad)
    links = [reader.link(element) for element in root.all("link")]
    joints = [reader.joint(element) for element in root.all("joint")]
    whole = tuple(joint for joint in joints if joint is not None)
    named = {link.name: link for link in links if link is not None}
    problems = reader.problems + _structure(file, list(filter(None, links)), whole)
    if problems:
        raise ConfigError("\n".join(problems))
    children = {joint.child for joint in whole}
    ratios, unread = _gear_ratios(root)
    return UrdfTree(
        name=root.attributes.get("name", ""),
        file=file,
        roots=tuple(name for name in named if name not in children),
        links=named,
        joints=whole,
        gear_ratios=ratios,
        unread_ratios=unread,
        angles_made_right=reader.angles_made_right,
    )


def _has_xacro(element: XmlElement) -> bool:
    """Return whether something is left to expand that is more than a colour."""
    return element.tag.startswith("xacro:") or any(
        _has_xacro(part) for part in element.children if part.tag not in ("visual", "gazebo")
    )


class _Reader:
    """Turns elements into links and joints, and keeps what is wrong with them."""

    def __init__(self, right_angle_tolerance_rad: float) -> None:
        self._tolerance_rad = right_angle_tolerance_rad
        self.angles_made_right = 0
        self.problems: list[str] = []

    def _try(self, read: Callable[[XmlElement], T], element: XmlElement) -> T | None:
        """Return what is read, or None, with the problem kept."""
        try:
            return read(element)
        except ConfigError as error:
            self.problems.append(str(error))
            return None

    def link(self, element: XmlElement) -> UrdfLink | None:
        """Return a link, or None where it has no name."""
        name = self._try(lambda found: found.attribute("name"), element)
        oddities: list[str] = []
        collisions: list[UrdfCollision] = []
        meshes: list[str] = []
        for part in element.all("collision"):
            placement = self._try(self._placement, part)
            for shape in (shape for held in part.all("geometry") for shape in held.children):
                if shape.tag == "mesh":
                    meshes.append(shape.attributes.get("filename", "?"))
                elif shape.tag in _SIZES and placement is not None:
                    size = self._try(_SIZES[shape.tag], shape)
                    if size is not None and size and min(size) > 0.0:
                        collisions.append(UrdfCollision(shape.tag, size, placement))
                    elif size is not None:
                        oddities.append(f"a <{shape.tag}> without size is no body")
        inertial = self._try(lambda found: found.one("inertial"), element)
        read = None
        if inertial is not None:
            read = self._try(lambda found: self._inertial(found, oddities), inertial)
        if name is None:
            return None
        return UrdfLink(
            name=name,
            where=element.where,
            inertial=read,
            collisions=tuple(collisions),
            meshes=tuple(meshes),
            oddities=tuple(oddities),
        )

    def joint(self, element: XmlElement) -> UrdfJoint | None:
        """Return a joint, or None where something of it cannot be read."""
        before = len(self.problems)
        name = self._try(lambda found: found.attribute("name"), element)
        kind = self._try(_kind, element)
        parent = self._try(_parent, element)
        child = self._try(_child, element)
        placement = self._try(self._placement, element)
        axis = self._try(_axis, element)
        limits = self._try(_limits, element)
        mimic = self._try(_mimics, element)
        if (
            len(self.problems) > before
            or (name is None or kind is None or placement is None)
            or (axis is None or limits is None or parent is None or child is None)
        ):
            return None
        return UrdfJoint(
            name=name,
            where=element.where,
            kind=kind,
            parent=parent,
            child=child,
            placement=placement,
            axis=axis,
            limits=limits,
            mimics=mimic,
        )

    def _inertial(self, element: XmlElement, oddities: list[str]) -> UrdfInertial | None:
        mass, inertia = element.one("mass"), element.one("inertia")
        if mass is None:
            oddities.append("its <inertial> has no <mass>: it counts as without mass")
            return None
        mass_kg = mass.number("value")
        if mass_kg < 0.0:
            oddities.append(f"its mass is {mass_kg:g} kg: it counts as without mass")
            return None
        matrix = np.zeros((3, 3))
        if inertia is not None:
            xx, xy, xz, yy, yz, zz = (
                inertia.numbers(key, 1, (0.0,))[0]
                for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
            )
            matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return UrdfInertial(mass_kg, self._placement(element), matrix)

    def _placement(self, element: XmlElement) -> FloatArray:
        """Return the <origin> of an element, (4, 4)."""
        placement = np.eye(4)
        origin = element.one("origin")
        if origin is not None:
            placement[:3, 3] = origin.numbers("xyz", 3, (0.0,) * 3)
            angles = origin.numbers("rpy", 3, (0.0,) * 3)
            placement[:3, :3] = rotation_of_rpy(*(self._right(angle) for angle in angles))
        return placement

    def _right(self, angle_rad: float) -> float:
        quarter = np.pi / 2.0
        exact = float(round(angle_rad / quarter) * quarter)
        if angle_rad != exact and abs(angle_rad - exact) <= self._tolerance_rad:
            self.angles_made_right += 1
            return exact
        return angle_rad


_SIZES: Final[dict[str, Callable[[XmlElement], tuple[float, ...]]]] = {
    "box": lambda shape: shape.numbers("size", 3, ()),
    "cylinder": lambda shape: (shape.number("radius"), shape.number("length")),
    "sphere": lambda shape: (shape.number("radius"),),
}


def _kind(element: XmlElement) -> str:
    kind = element.attribute("type")
    if kind not in KINDS:
        raise ConfigError(f"{element.where}: joint type {kind!r} is none of {', '.join(KINDS)}")
    return kind


def _end(element: XmlElement, tag: str) -> str:
    end = element.one(tag)
    if end is None:
        raise ConfigError(f"{element.where}: the joint has no <{tag}>")
    return end.attribute("link")


def _parent(element: XmlElement) -> str:
    return _end(element, "parent")


def _child(element: XmlElement) -> str:
    return _end(element, "child")


def _axis(element: XmlElement) -> FloatArray:
    """Return the unit vector of a joint's axis, (3,); x where none is stated."""
    stated = element.one("axis")
    axis = np.array([1.0, 0.0, 0.0])
    if stated is not None:
        axis = np.array(stated.numbers("xyz", 3, (1.0, 0.0, 0.0)))
    length = float(np.linalg.norm(axis))
    if length < 1e-6 and element.attributes.get("type") in MOVING:
        raise ConfigError(f"{element.where}: the joint's axis has no direction")
    return axis / max(length, 1e-6)


def _limits(element: XmlElement) -> dict[str, float]:
    """Return which limits are stated as finite numbers."""
    stated = element.one("limit")
    limits: dict[str, float] = {}
    for key, text in stated.attributes.items() if stated is not None else ():
        try:
            value = float(text)
        except ValueError:
            continue
        if key in _LIMITS and math.isfinite(value):
            limits[key] = value
    return limits


def _mimics(element: XmlElement) -> str | None:
    mimic = element.one("mimic")
    return mimic.attribute("joint") if mimic is not None else None


def _structure(file: str, links: list[UrdfLink], joints: tuple[UrdfJoint, ...]) -> list[str]:
    """Return why links and joints make no trees, a line each."""
    if len(joints) > MOST_JOINTS:
        return [f"{file}: {len(joints)} joints; at most {MOST_JOINTS} are read"]
    problems = []
    names = Counter[str]()
    for link in links:
        names[link.name] += 1
        if names[link.name] == 2:
            problems.append(f"{link.where}: a second link is called {link.name!r}")
    called, hung = Counter[str](), Counter[str]()
    for joint in joints:
        called[joint.name] += 1
        hung[joint.child] += 1
        if called[joint.name] == 2:
            problems.append(f"{joint.where}: a second joint is called {joint.name!r}")
        problems += [
            f"{joint.where}: joint {joint.name!r} names no link {link!r}: add it, or remove the"
            " joint"
            for link in (joint.parent, joint.child)
            if link not in names
        ]
        if hung[joint.child] == 2:
            problems.append(
                f"{joint.where}: link {joint.child!r} hangs on two joints: closed chains cannot be"
                " told in a URDF"
            )
    above = {joint.child: joint.parent for joint in joints}
    grounded = {name for name in names if name not in above}
    for name in names:
        way: list[str] = []
        at = name
        while at not in grounded and at in above and at not in way:
            way.append(at)
            at = above[at]
        if at in way:
            problems.append(f"{file}: the links {', '.join(sorted(way))} hang on one another")
            break
        grounded.update(way)
    if not names:
        problems.append(
            f"{file}: there is no link: a xacro file that only defines macros expands to nothing;"
            " expand the one that calls them"
        )
    return problems


def _gear_ratios(root: XmlElement) -> tuple[dict[str, float], dict[str, str]]:
    """Return the reductions of simple transmissions by joint, and those that are none.

    Told are those of a joint that has a transmission of its own: in the transmission itself (the
    oldest form), in its actuator or its joint, or in <ros2_control>.
    """
    ratios: dict[str, float] = {}
    unread: dict[str, str] = {}
    holders = [root, *root.all("ros2_control")]
    for element in (found for holder in holders for found in holder.all("transmission")):
        joints = [part for part in element.all("joint") if "name" in part.attributes]
        stated = [
            reduction.text
            for holder in (element, *element.all("joint"), *element.all("actuator"))
            for tag in ("mechanicalReduction", "mechanical_reduction")
            for reduction in holder.all(tag)
        ]
        if not stated or not joints:
            continue
        ratio = _ratio(stated[0]) if len(stated) == len(joints) == 1 else None
        for joint in joints:
            if ratio is not None:
                ratios[joint.attributes["name"]] = ratio
            else:
                unread[joint.attributes["name"]] = " ".join(stated)
    return ratios, unread


def _ratio(text: str) -> float | None:
    try:
        ratio = float(text)
    except ValueError:
        return None
    return ratio if ratio != 0.0 and abs(ratio) < _LARGEST_RATIO else None
