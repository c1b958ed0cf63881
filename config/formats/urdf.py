"""`UrdfTree`: links and joints of a URDF file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.errors import ConfigError

MOVING: Final = ("revolute", "continuous", "prismatic")
KINDS: Final = (*MOVING, "fixed", "floating", "planar")


@dataclass(frozen=True, eq=False)
class UrdfInertial:
    """Mass of a link, placement (4, 4) of its centre's frame, inertia (3, 3) about the centre."""

    mass_kg: float
    placement: FloatArray
    inertia_kg_m2: FloatArray


@dataclass(frozen=True, eq=False)
class UrdfPrimitive:
    """A box, cylinder or sphere; `size` has its dimensions [m], `placement` is in the link."""

    shape: str
    size: tuple[float, ...]
    placement: FloatArray


@dataclass(frozen=True, eq=False)
class UrdfMesh:
    """A mesh that a link names.

    Attributes:
        where: `file:line` of the element.
        address: Address of the mesh's file, as written.
        scale: Factors on the mesh's coordinates; a negative factor mirrors it.
        placement: Pose (4, 4) of the mesh in the link's frame.
    """

    where: str
    address: str
    scale: tuple[float, float, float]
    placement: FloatArray


@dataclass(frozen=True)
class UrdfGeometry:
    """Primitives and meshes of a link's <collision> or <visual> elements."""

    primitives: tuple[UrdfPrimitive, ...] = ()
    meshes: tuple[UrdfMesh, ...] = ()

    @property
    def is_empty(self) -> bool:
        """True if there are neither primitives nor meshes."""
        return not self.primitives and not self.meshes


@dataclass(frozen=True)
class UrdfLink:
    """A link; `oddities` describes its invalid elements and how they were read."""

    name: str
    where: str
    inertial: UrdfInertial | None
    collision: UrdfGeometry
    visual: UrdfGeometry
    oddities: tuple[str, ...]

    @property
    def solid(self) -> UrdfGeometry:
        """The geometry for collision checks: <collision> or, without it, <visual>."""
        return self.visual if self.collision.is_empty else self.collision


@dataclass(frozen=True)
class Mimic:
    """The joint that a mimic joint follows: its position times `multiplier`, plus `offset`."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """A joint; `placement` (4, 4) is the child's frame in the parent's at position zero.

    Attributes:
        limits: The stated lower, upper, velocity, effort, acceleration, deceleration, soft_lower
            and soft_upper; infinite if the file states infinity.
        mimic: The joint that this joint mimics.
        damping, friction: Viscous and Coulomb friction [N m s/rad or N s/m, N m or N].
        rotor_inertia_kg_m2: Inertia of the motor's rotor, before the gear.
    """

    name: str
    where: str
    kind: str
    parent: str
    child: str
    placement: FloatArray
    axis: FloatArray
    limits: dict[str, float]
    mimic: Mimic | None
    damping: float | None = None
    friction: float | None = None
    rotor_inertia_kg_m2: float | None = None

    @property
    def is_driven(self) -> bool:
        """True if the joint moves and does not mimic another joint."""
        return self.kind in MOVING and self.mimic is None

    @property
    def resting_position(self) -> float:
        """The joint's position within its limits that is closest to zero [rad or m]."""
        low, high = self.limits.get("lower", 0.0), self.limits.get("upper", 0.0)
        if self.kind not in MOVING or low > high:
            return 0.0
        return min(max(0.0, low), high)

    def placement_at(self, position: float) -> FloatArray:
        """Return the child's frame in the parent's, (4, 4), at a position [rad or m]."""
        moved = np.eye(4)
        if self.kind == "prismatic":
            moved[:3, 3] = position * self.axis
        elif self.kind in MOVING:
            x, y, z = self.axis
            across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
            turn = np.sin(position) * across + (1.0 - np.cos(position)) * across @ across
            moved[:3, :3] += turn
        return np.asarray(self.placement @ moved)


@dataclass(frozen=True)
class UrdfTree:
    """A whole URDF with one tree or several.

    Attributes:
        name, file: Names of the robot and of the file.
        roots: The links that are not the child of a joint.
        links: Links by name.
        joints: Joints in the file's order.
        gear_ratios: The reductions of simple transmissions, by joint.
        unread_ratios: Reductions that are not a single ratio, as written in the file, by joint.
        notes: Notes on values that were corrected and parts that are not read.
    """

    name: str
    file: str
    roots: tuple[str, ...]
    links: dict[str, UrdfLink]
    joints: tuple[UrdfJoint, ...]
    gear_ratios: dict[str, float]
    unread_ratios: dict[str, str]
    notes: tuple[str, ...]

    @cached_property
    def joint_above(self) -> dict[str, UrdfJoint]:
        """The parent joint of each link; a root has none."""
        return {joint.child: joint for joint in self.joints}

    @cached_property
    def joints_below(self) -> dict[str, list[UrdfJoint]]:
        """The child joints of each link, in the file's order."""
        below: dict[str, list[UrdfJoint]] = {}
        for joint in self.joints:
            below.setdefault(joint.parent, []).append(joint)
        return below

    def root_of(self, link: str) -> str:
        """Return the root of the tree that contains a link."""
        while link in self.joint_above:
            link = self.joint_above[link].parent
        return link

    def path(self, base: str, tip: str) -> tuple[UrdfJoint, ...]:
        """Return the joints from base to tip, of any kind.

        Raises:
            ConfigError: The tip is not below the base.
        """
        joints: list[UrdfJoint] = []
        link = tip
        while link != base:
            joint = self.joint_above.get(link)
            if joint is None:
                raise ConfigError(
                    f"{self.file}: link {tip!r} is not below {base!r}; give another --base or"
                    " --tip",
                    code="RID-URDF-LINK",
                )
            joints.append(joint)
            link = joint.parent
        return tuple(joints[::-1])

    def placements(
        self, base: str, positions: Mapping[str, float] | None = None
    ) -> dict[str, FloatArray]:
        """Return the pose of every link below the base in the base's frame, (4, 4) each.

        Args:
            base: The reference link.
            positions: Positions of joints [rad or m]; zero if not given.
        """
        stand = positions or {}
        places: dict[str, FloatArray] = {base: np.eye(4)}
        waiting = [base]
        while waiting:
            link = waiting.pop()
            for joint in self.joints_below.get(link, ()):
                at = stand.get(joint.name, 0.0)
                places[joint.child] = places[link] @ joint.placement_at(at)
                waiting.append(joint.child)
        return places


def rotation_of_rpy(roll: float, pitch: float, yaw: float) -> FloatArray:
    """Return Rot_z(yaw) Rot_y(pitch) Rot_x(roll), (3, 3), the meaning of `rpy` in a URDF."""
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rpy_of_rotation(rotation: FloatArray) -> tuple[float, float, float]:
    """Return roll, pitch and yaw of a rotation (3, 3), exact except for rounding."""
    level = float(np.hypot(rotation[0, 0], rotation[1, 0]))
    pitch = float(np.arctan2(-rotation[2, 0], level))
    yaw = float(np.arctan2(rotation[1, 0], rotation[0, 0])) if level > 1e-15 else 0.0
    # if the pitch is 90 degrees, any yaw is valid; zero is chosen
    rest = rotation_of_rpy(0.0, pitch, yaw).T @ rotation
    return float(np.arctan2(rest[2, 1], rest[1, 1])), pitch, yaw
