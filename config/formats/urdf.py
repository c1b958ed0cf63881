"""`UrdfTree`: links and joints as a URDF file states them, checked one by one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.errors import ConfigError
from config.formats.xml_tree import XmlElement, parse_xml

RIGHT_ANGLE_TOLERANCE_RAD: Final = 1e-5
MOVING: Final = ("revolute", "continuous", "prismatic")
KINDS: Final = (*MOVING, "fixed", "floating", "planar")
MOST_JOINTS: Final = 2000


@dataclass(frozen=True, eq=False)
class UrdfInertial:
    """Mass, placement (4, 4) of the centre's frame in the link, inertia (3, 3) about the centre."""

    mass_kg: float
    placement: FloatArray
    inertia_kg_m2: FloatArray


@dataclass(frozen=True, eq=False)
class UrdfCollision:
    """A primitive of a link's collision geometry; `size` is what the shape needs, in m."""

    shape: str
    size: tuple[float, ...]
    placement: FloatArray


@dataclass(frozen=True)
class UrdfLink:
    """A link; `meshes` are the files of its collision geometry, which are not read."""

    name: str
    where: str
    inertial: UrdfInertial | None
    collisions: tuple[UrdfCollision, ...]
    meshes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """A joint; `placement` (4, 4) is the child's frame in the parent's at position zero."""

    name: str
    where: str
    kind: str
    parent: str
    child: str
    placement: FloatArray
    axis: FloatArray
    limits: dict[str, float]
    mimics: str | None


@dataclass(frozen=True)
class UrdfTree:
    """A whole URDF. `angles_made_right` counts angles that were taken as whole quarter turns."""

    name: str
    file: str
    root: str
    links: dict[str, UrdfLink]
    joints: tuple[UrdfJoint, ...]
    gear_ratios: dict[str, float]
    angles_made_right: int

    @cached_property
    def joint_above(self) -> dict[str, UrdfJoint]:
        """The joint that a link is the child of; the root has none."""
        return {joint.child: joint for joint in self.joints}

    @cached_property
    def joints_below(self) -> dict[str, list[UrdfJoint]]:
        """The joints that a link is the parent of, in the file's order."""
        below: dict[str, list[UrdfJoint]] = {}
        for joint in self.joints:
            below.setdefault(joint.parent, []).append(joint)
        return below


def read_urdf(
    data: bytes, file: str, *, right_angle_tolerance_rad: float = RIGHT_ANGLE_TOLERANCE_RAD
) -> UrdfTree:
    """Read a URDF (ROS, "URDF XML specification").

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
        The file is not XML, not a URDF, or not one tree.
    """
    root = parse_xml(data, file)
    if root.tag != "robot":
        raise ConfigError(f"{root.where}: the root is <{root.tag}>, a URDF begins with <robot>")
    if any(element.tag.startswith("xacro:") for element in root.children):
        raise ConfigError(
            f"{file}: this is a xacro file: expand it first (xacro FILE > robot.urdf)"
        )
    reader = _Reader(right_angle_tolerance_rad)
    links: dict[str, UrdfLink] = {}
    for element in root.all("link"):
        link = reader.link(element)
        if link.name in links:
            raise ConfigError(f"{link.where}: a second link is called {link.name!r}")
        links[link.name] = link
    joints = tuple(reader.joint(element) for element in root.all("joint"))
    return UrdfTree(
        name=root.attributes.get("name", ""),
        file=file,
        root=_root(file, links, joints),
        links=links,
        joints=joints,
        gear_ratios=_gear_ratios(root),
        angles_made_right=reader.angles_made_right,
    )


class _Reader:
    """Turns elements into links and joints."""

    def __init__(self, right_angle_tolerance_rad: float) -> None:
        self._tolerance_rad = right_angle_tolerance_rad
        self.angles_made_right = 0

    def link(self, element: XmlElement) -> UrdfLink:
        collisions: list[UrdfCollision] = []
        meshes: list[str] = []
        for part in element.all("collision"):
            geometry = part.one("geometry")
            for shape in geometry.children if geometry is not None else ():
                if shape.tag == "mesh":
                    meshes.append(shape.attributes.get("filename", "?"))
                elif (size := _size(shape)) is not None:
                    collisions.append(UrdfCollision(shape.tag, size, self._placement(part)))
        return UrdfLink(
            name=element.attribute("name"),
            where=element.where,
            inertial=self._inertial(element.one("inertial")),
            collisions=tuple(collisions),
            meshes=tuple(meshes),
        )

    def joint(self, element: XmlElement) -> UrdfJoint:
        kind = element.attribute("type")
        if kind not in KINDS:
            raise ConfigError(f"{element.where}: joint type {kind!r} is none of {', '.join(KINDS)}")
        ends = []
        for tag in ("parent", "child"):
            end = element.one(tag)
            if end is None:
                raise ConfigError(f"{element.where}: the joint has no <{tag}>")
            ends.append(end.attribute("link"))
        axis_element, limit, mimic = element.one("axis"), element.one("limit"), element.one("mimic")
        axis = np.array([1.0, 0.0, 0.0])
        if axis_element is not None:
            axis = np.array(axis_element.numbers("xyz", 3, (1.0, 0.0, 0.0)))
        length = float(np.linalg.norm(axis))
        if kind in MOVING and length < 1e-6:
            raise ConfigError(f"{element.where}: the joint's axis has no direction")
        limits = {}
        if limit is not None:
            limits = {key: limit.number(key) for key in limit.attributes if key in _LIMITS}
        return UrdfJoint(
            name=element.attribute("name"),
            where=element.where,
            kind=kind,
            parent=ends[0],
            child=ends[1],
            placement=self._placement(element),
            axis=axis / max(length, 1e-6),
            limits=limits,
            mimics=mimic.attribute("joint") if mimic is not None else None,
        )

    def _inertial(self, element: XmlElement | None) -> UrdfInertial | None:
        if element is None:
            return None
        mass, inertia = element.one("mass"), element.one("inertia")
        if mass is None or inertia is None:
            raise ConfigError(f"{element.where}: <inertial> needs both <mass> and <inertia>")
        mass_kg = mass.number("value")
        if mass_kg < 0.0:
            raise ConfigError(f"{mass.where}: the mass is {mass_kg:g} kg")
        xx, xy, xz, yy, yz, zz = (
            inertia.numbers(key, 1, (0.0,))[0] for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
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


_LIMITS: Final = ("lower", "upper", "velocity", "effort")


def rotation_of_rpy(roll: float, pitch: float, yaw: float) -> FloatArray:
    """Return Rot_z(yaw) Rot_y(pitch) Rot_x(roll), (3, 3): what `rpy` of a URDF means."""
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rpy_of_rotation(rotation: FloatArray) -> tuple[float, float, float]:
    """Return roll, pitch and yaw of a rotation (3, 3), to rounding at every attitude."""
    level = float(np.hypot(rotation[0, 0], rotation[1, 0]))
    pitch = float(np.arctan2(-rotation[2, 0], level))
    yaw = float(np.arctan2(rotation[1, 0], rotation[0, 0])) if level > 1e-15 else 0.0
    rest = rotation_of_rpy(0.0, pitch, yaw).T @ rotation  # whatever yaw is near pitch = 90 degrees
    return float(np.arctan2(rest[2, 1], rest[1, 1])), pitch, yaw


def _size(shape: XmlElement) -> tuple[float, ...] | None:
    if shape.tag == "box":
        size = shape.numbers("size", 3, ())
    elif shape.tag == "cylinder":
        size = (shape.number("radius"), shape.number("length"))
    elif shape.tag == "sphere":
        size = (shape.number("radius"),)
    else:
        return None
    if not size or min(size) <= 0.0:
        raise ConfigError(f"{shape.where}: the <{shape.tag}> has no size above 0")
    return size


def _root(file: str, links: dict[str, UrdfLink], joints: tuple[UrdfJoint, ...]) -> str:
    """Return the only link that is no joint's child, and check that all hang on it."""
    if len(joints) > MOST_JOINTS:
        raise ConfigError(f"{file}: {len(joints)} joints; at most {MOST_JOINTS} are read")
    names = [joint.name for joint in joints]
    for joint in joints:
        if names.count(joint.name) > 1:
            raise ConfigError(f"{joint.where}: a second joint is called {joint.name!r}")
        for link in (joint.parent, joint.child):
            if link not in links:
                raise ConfigError(f"{joint.where}: joint {joint.name!r} names no link {link!r}")
    children = [joint.child for joint in joints]
    for joint in joints:
        if children.count(joint.child) > 1:
            raise ConfigError(
                f"{joint.where}: link {joint.child!r} hangs on two joints: closed chains cannot be"
                " told in a URDF"
            )
    roots = [name for name in links if name not in children]
    if len(roots) != 1:
        raise ConfigError(
            f"{file}: {len(roots)} links hang on no joint ({', '.join(roots) or 'a loop'});"
            " one, the base, must"
        )
    reached, waiting = set[str](), [roots[0]]
    while waiting:
        link = waiting.pop()
        reached.add(link)
        waiting += [joint.child for joint in joints if joint.parent == link]
    if len(reached) < len(links):
        raise ConfigError(
            f"{file}: {', '.join(sorted(set(links) - reached))} do not hang on {roots[0]!r}"
        )
    return roots[0]


def _gear_ratios(root: XmlElement) -> dict[str, float]:
    """Return the reductions of simple transmissions by joint."""
    ratios: dict[str, float] = {}
    for element in root.all("transmission"):
        joints = element.all("joint")
        reductions = [
            reduction
            for holder in (*joints, *element.all("actuator"))
            for reduction in holder.all("mechanicalReduction")
        ]
        if len(joints) == 1 and len(reductions) == 1 and "name" in joints[0].attributes:
            try:
                ratio = float(reductions[0].text)
            except ValueError:
                ratio = 0.0
            if ratio == 0.0 or not abs(ratio) < 1e6:
                raise ConfigError(
                    f"{reductions[0].where}: mechanicalReduction {reductions[0].text!r} is no ratio"
                )
            ratios[joints[0].attributes["name"]] = ratio
    return ratios
