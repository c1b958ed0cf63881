"""Conversion of a URDF file (ROS, "URDF XML specification") to a `UrdfTree`.

A file with an unreadable number or an invalid tree of links and joints is refused; the message
lists all such errors. Errors in a <visual> do not matter. An element that is readable but states
nothing (a box without size, an unknown inertia) is ignored and noted in the `oddities` of its link.
"""

from __future__ import annotations

import re
import shlex
from collections import Counter
from collections.abc import Callable
from typing import Final, TypeVar

import numpy as np

from config.arrays import FloatArray
from config.errors import ConfigError
from config.formats.number import is_not_finite
from config.formats.rounded_angle import AngleReading, angle_notes
from config.formats.urdf import (
    MOVING,
    UrdfGeometry,
    UrdfInertial,
    UrdfJoint,
    UrdfLink,
    UrdfMesh,
    UrdfPrimitive,
    UrdfTree,
    rotation_of_rpy,
)
from config.formats.urdf_joint import (
    joint_axis,
    joint_dynamics,
    joint_end,
    joint_kind,
    joint_limits,
    joint_mimic,
)
from config.formats.urdf_transmission import Transmissions, transmissions_of
from config.formats.urdf_unread import refused_parts, unread_parts
from config.formats.xml_tree import XmlElement, parse_xml

MOST_JOINTS: Final = 2000
LARGEST_ANGLE_RAD: Final = 2.0 * np.pi + 0.01
RIGHT_ANGLE_RAD: Final = 1e-5
UNIT_LENGTH: Final = 1e-2

_FIND: Final = re.compile(rb"\$\(find(?:-pkg-share)?\s+([^\s)]+)\s*\)")

T = TypeVar("T")


def read_urdf(data: bytes, file: str, *, literal_angles: bool = False) -> UrdfTree:
    """Read a URDF.

    Args:
        data: The file's bytes.
        file: Name of the file in messages.
        literal_angles: Use angles as written. Otherwise a multiple of 15 degrees that is rounded to
            few digits is replaced by the exact multiple (`AngleReading`).

    Raises:
        ConfigError: The file is not XML, is not a URDF, or its links and joints cannot be read or
            do not form trees; one line per problem.
    """
    root = parse_xml(data, file)
    if root.tag != "robot":
        raise ConfigError(
            f"{root.where}: the root element is <{root.tag}>; a URDF begins with <robot>",
            code="RID-FILE-TYPE",
        )
    if _has_xacro(root):
        raise ConfigError(_xacro_remedy(data, file), code="RID-URDF-XACRO")
    reader = _Reader(literal_angles)
    gears = transmissions_of(root)
    links = [reader.link(element) for element in root.all("link")]
    joints = [reader.joint(element, gears) for element in root.all("joint")]
    whole = tuple(joint for joint in joints if joint is not None)
    named = {link.name: link for link in links if link is not None}
    structure = _structure_errors(file, list(filter(None, links)), whole)
    errors = [*refused_parts(root), *reader.errors, *gears.errors]
    if errors or structure:
        code = errors[0].refusal if errors else "RID-URDF-STRUCTURE"
        raise ConfigError("\n".join((*map(str, errors), *structure)), code=code)
    children = {joint.child for joint in whole}
    unknown = sorted({*gears.ratios, *gears.rotors_kg_m2} - {joint.name for joint in whole})
    if unknown:
        reader.notes.append(f"transmissions of {', '.join(unknown)}: no joint has this name")
    return UrdfTree(
        name=root.attributes.get("name", ""),
        file=file,
        roots=tuple(name for name in named if name not in children),
        links=named,
        joints=whole,
        gear_ratios=gears.ratios,
        unread_ratios=gears.unread,
        notes=(*angle_notes(reader.angles), *reader.notes, *unread_parts(root)),
    )


def _has_xacro(element: XmlElement) -> bool:
    """Return whether xacro elements remain unexpanded, except in visuals and Gazebo elements."""
    return element.tag.startswith("xacro:") or any(
        _has_xacro(part) for part in element.children if part.tag not in ("visual", "gazebo")
    )


def _xacro_remedy(data: bytes, file: str) -> str:
    """Return the error text for a xacro file, with the commands that expand it."""
    packages = dict.fromkeys(name.decode(errors="replace") for name in _FIND.findall(data))
    where = (
        f" FOLDER contains the packages {', '.join(packages)}, in itself or in folders below."
        if packages
        else " If a package of $(find …) is not found, add -d FOLDER with its folder."
    )
    words = f"xacrodoc {shlex.quote(file)} -o robot.urdf{' -d FOLDER' if packages else ''}"
    return (
        f"{file}: this is a xacro file. Expand it with `pip install xacrodoc` and `{words}`, and"
        f" give robot.urdf.{where}"
    )


class _Reader:
    """Converter of elements to links and joints; it collects their errors and notes."""

    def __init__(self, literal_angles: bool) -> None:
        self._literal = literal_angles
        self.angles: list[tuple[str, AngleReading]] = []
        self.notes: list[str] = []
        self.errors: list[ConfigError] = []

    def _try(self, read: Callable[[XmlElement], T], element: XmlElement) -> T | None:
        """Return the result of `read`; on an error store it and return None."""
        try:
            return read(element)
        except ConfigError as error:
            self.errors.append(error)
            return None

    def link(self, element: XmlElement) -> UrdfLink | None:
        """Return a link; None if it has no name."""
        name = self._try(lambda found: found.attribute("name"), element)
        oddities: list[str] = []
        collision = self._geometry(element.all("collision"), oddities)
        shown, of_visual = _Reader(self._literal), list[str]()
        visual = shown._geometry(element.all("visual"), of_visual)
        if collision.is_empty:
            oddities += [*of_visual, *map(str, shown.errors)]
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
            collision=collision,
            visual=visual,
            oddities=tuple(oddities),
        )

    def _geometry(self, parts: list[XmlElement], oddities: list[str]) -> UrdfGeometry:
        """Return the shapes of <collision> or <visual> elements."""
        primitives: list[UrdfPrimitive] = []
        meshes: list[UrdfMesh] = []
        for part in parts:
            placement = self._try(self._placement, part)
            for shape in (shape for held in part.all("geometry") for shape in held.children):
                if placement is None or shape.tag not in (*_SIZES, "mesh"):
                    continue
                if shape.tag == "mesh":
                    address = self._try(lambda found: found.attribute("filename"), shape)
                    size = self._try(lambda found: found.numbers("scale", 3, (1.0,) * 3), shape)
                else:
                    address = None
                    size = self._try(_SIZES[shape.tag], shape)
                if size is None:
                    continue
                if not size or (min(map(abs, size)) if shape.tag == "mesh" else min(size)) <= 0.0:
                    oddities.append(f"a <{shape.tag}> without size is ignored")
                elif shape.tag != "mesh":
                    primitives.append(UrdfPrimitive(shape.tag, size, placement))
                elif address is not None:
                    x, y, z = size
                    meshes.append(UrdfMesh(shape.where, address, (x, y, z), placement))
        return UrdfGeometry(tuple(primitives), tuple(meshes))

    def joint(self, element: XmlElement, gears: Transmissions) -> UrdfJoint | None:
        """Return a joint; None if the element has an error."""
        before = len(self.errors)
        name = self._try(lambda found: found.attribute("name"), element)
        kind = self._try(joint_kind, element)
        parent = self._try(lambda found: joint_end(found, "parent"), element)
        child = self._try(lambda found: joint_end(found, "child"), element)
        placement = self._try(self._placement, element)
        axis = self._try(joint_axis, element)
        limits = self._try(joint_limits, element)
        dynamics = self._try(joint_dynamics, element)
        mimic = self._try(joint_mimic, element)
        if (
            len(self.errors) > before
            or (name is None or kind is None or placement is None or dynamics is None)
            or (axis is None or limits is None or parent is None or child is None)
        ):
            return None
        direction, length = axis
        if kind in MOVING and abs(length - 1.0) > UNIT_LENGTH:
            self.notes.append(
                f"{element.where}: the axis of joint {name!r} has the length {length:.4g} and was"
                " scaled to 1"
            )
        return UrdfJoint(
            name=name,
            where=element.where,
            kind=kind,
            parent=parent,
            child=child,
            placement=placement,
            axis=direction,
            limits=limits,
            mimic=mimic,
            damping=dynamics.damping,
            friction=dynamics.friction,
            rotor_inertia_kg_m2=gears.rotors_kg_m2.get(name, dynamics.rotor_inertia_kg_m2),
        )

    def _inertial(self, element: XmlElement, oddities: list[str]) -> UrdfInertial | None:
        mass, inertia = element.one("mass"), element.one("inertia")
        if mass is None:
            oddities.append("its <inertial> has no <mass>; the link counts as massless")
            return None
        mass_kg = mass.number("value")
        if mass_kg < 0.0:
            raise ConfigError(
                f"{mass.where}: mass is {mass_kg:g} kg; it cannot be negative",
                code="RID-URDF-VALUE",
            )
        matrix = np.zeros((3, 3))
        if inertia is not None:
            words = [inertia.attributes.get(key, "0") for key in _ELEMENTS]
            if any(is_not_finite(word) for word in words):
                oddities.append(
                    f"its inertia ({inertia.where}) is not a finite number; it counts as unknown"
                )
            else:
                xx, xy, xz, yy, yz, zz = (inertia.numbers(key, 1, (0.0,))[0] for key in _ELEMENTS)
                matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return UrdfInertial(mass_kg, self._placement(element), matrix)

    def _placement(self, element: XmlElement) -> FloatArray:
        """Return the <origin> of an element, (4, 4)."""
        placement = np.eye(4)
        origin = element.one("origin")
        if origin is not None:
            placement[:3, 3] = origin.numbers("xyz", 3, (0.0,) * 3)
            angles = origin.numbers("rpy", 3, (0.0,) * 3)
            if max(map(abs, angles)) > LARGEST_ANGLE_RAD:
                raise ConfigError(
                    f"{origin.where}: rpy of <origin> is {origin.attributes['rpy']!r}, more than a"
                    " turn. A URDF uses radians: are these degrees?",
                    code="RID-URDF-ANGLE",
                )
            placement[:3, :3] = rotation_of_rpy(*(self._angle(origin, each) for each in angles))
        return placement

    def _angle(self, origin: XmlElement, angle_rad: float) -> float:
        if self._literal:
            return angle_rad
        reading = AngleReading.of(angle_rad, RIGHT_ANGLE_RAD)
        self.angles.append((origin.where, reading))
        return reading.used_rad


_ELEMENTS: Final = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_SIZES: Final[dict[str, Callable[[XmlElement], tuple[float, ...]]]] = {
    "box": lambda shape: shape.numbers("size", 3, ()),
    "cylinder": lambda shape: (shape.number("radius"), shape.number("length")),
    "sphere": lambda shape: (shape.number("radius"),),
}


def _structure_errors(file: str, links: list[UrdfLink], joints: tuple[UrdfJoint, ...]) -> list[str]:
    """Return why links and joints do not form trees, one line per problem."""
    if len(joints) > MOST_JOINTS:
        return [f"{file}: {len(joints)} joints; at most {MOST_JOINTS} are allowed"]
    problems = []
    names = Counter[str]()
    for link in links:
        names[link.name] += 1
        if names[link.name] == 2:
            problems.append(f"{link.where}: a second link is named {link.name!r}; rename one")
    called, hung = Counter[str](), Counter[str]()
    for joint in joints:
        called[joint.name] += 1
        hung[joint.child] += 1
        if called[joint.name] == 2:
            problems.append(f"{joint.where}: a second joint is named {joint.name!r}; rename one")
        problems += [
            f"{joint.where}: joint {joint.name!r} refers to a missing link {link!r}; add it, or"
            " remove the joint"
            for link in (joint.parent, joint.child)
            if link not in names
        ]
        if hung[joint.child] == 2:
            problems.append(
                f"{joint.where}: link {joint.child!r} is the child of two joints; a URDF cannot"
                " describe closed chains"
            )
    problems += _mimic_errors(joints)
    above = {joint.child: joint.parent for joint in joints}
    grounded = {name for name in names if name not in above}
    for name in names:
        way: list[str] = []
        at = name
        while at not in grounded and at in above and at not in way:
            way.append(at)
            at = above[at]
        if at in way:
            problems.append(f"{file}: the links {', '.join(sorted(way))} form a loop; correct it")
            break
        grounded.update(way)
    if not names:
        problems.append(
            f"{file}: it contains no link. A xacro file that only defines macros expands to"
            " nothing; expand the file that calls them"
        )
    return problems


def _mimic_errors(joints: tuple[UrdfJoint, ...]) -> list[str]:
    """Return errors of joints that mimic themselves or a joint that does not exist."""
    leaders = {joint.name: joint.mimic.joint if joint.mimic else None for joint in joints}
    problems = []
    for joint in joints:
        followed: list[str] = []
        leader = leaders[joint.name]
        while leader is not None and leader in leaders and leader not in followed:
            followed.append(leader)
            leader = leaders[leader]
        if leader is not None:
            what = (
                "mimics itself"
                if leader in leaders
                else f"mimics {leader!r}, which is not a joint of the file"
            )
            problems.append(f"{joint.where}: joint {joint.name!r} {what}; correct <mimic>")
    return problems
