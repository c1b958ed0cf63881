"""`RobotScene`: everything that is drawn of a robot, independent of its pose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from config.arrays import FloatArray
from config.cell.plate import PlateConfig
from config.formats.urdf import rotation_of_rpy
from config.meshes.mesh import Mesh
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain, flange_pose
from rid_daq.robot_view.link_shapes import (
    ShapeKind,
    body_meshes,
    schematic_meshes,
    stored_meshes,
)


@dataclass(frozen=True, eq=False)
class SceneJoint:
    """A joint of the scene.

    Attributes:
        name: Name of the joint.
        origin: Shape (4, 4). The joint's frame at position 0, in the frame of the previous link.
        axis: Shape (3,). Axis in the joint's frame; a positive position turns or slides along it.
        kind: Kind of joint.
        limits: Lowest and highest position [rad or m].
    """

    name: str
    origin: FloatArray
    axis: FloatArray
    kind: Literal["revolute", "prismatic"]
    limits: tuple[float, float]

    def pose(self, position: float) -> FloatArray:
        """Return the link's frame in the frame of the previous link, (4, 4)."""
        motion = np.eye(4)
        if self.kind == "prismatic":
            motion[:3, 3] = position * self.axis
        else:
            motion[:3, :3] = _rotation_about(self.axis, position)
        return np.asarray(self.origin @ motion)


@dataclass(frozen=True, eq=False)
class RobotScene:
    """Everything that is drawn of a robot, independent of its pose.

    Link 0 is the base. Link i is moved by joint i and has its frame.

    Attributes:
        robot: Name of the robot.
        shape: Origin of the shape.
        upright: Shape (3, 3). Rotation from the base frame to the view, in which gravity points
            along -z.
        gravity_m_s2: Shape (3,). Acceleration of gravity in the base frame.
        joints: The joints, base to flange.
        links: Triangles of each link in its frame.
        small_links: The same links with at most `SMALL_TRIANGLES` triangles.
        tool: Shape (4, 4). Tool frame in the frame of the last link.
        plate: Shape (4, 4). Frame of the force plate in the base frame; None without a plate.
        payload_centre_m: Shape (3,). Centre of gravity of a payload in the frame of the last link;
            None without a payload.
    """

    robot: str
    shape: ShapeKind
    upright: FloatArray
    gravity_m_s2: FloatArray
    joints: tuple[SceneJoint, ...]
    links: tuple[Mesh, ...]
    small_links: tuple[Mesh, ...]
    tool: FloatArray
    plate: FloatArray | None = None
    payload_centre_m: FloatArray | None = None

    @classmethod
    def of(
        cls,
        robot: RobotDescription,
        plate: PlateConfig | None = None,
        payload_centre_m: npt.ArrayLike | None = None,
        meshes: bytes | None = None,
    ) -> RobotScene:
        """Return the scene of a robot.

        Args:
            robot: The robot.
            plate: Force plate of its cell.
            payload_centre_m: Shape (3,). Centre of gravity of a payload in the flange's frame,
                which is the tool frame of the robot file.
            meshes: Bytes of the file `meshes` of the robot file; None to draw bodies.

        Raises:
            ConfigError: The meshes are damaged, or of another number of links.
        """
        joints, tool = _joints(robot), flange_pose(robot)
        gravity = np.array(robot.gravity_m_s2)
        shape: ShapeKind
        if robot.meshes is not None and meshes is not None:
            shape = "meshes"
            links, small = stored_meshes(robot, robot.meshes.file, meshes)
        elif robot.bodies:
            shape = "bodies"
            links, small = body_meshes(robot)
        else:
            shape = "schematic"
            ends = [joint.origin[:3, 3] for joint in joints]
            links = schematic_meshes([*ends, tool[:3, 3]], [joint.axis for joint in joints])
            small = links
        centre = None
        if payload_centre_m is not None:
            centre = tool[:3, :3] @ np.asarray(payload_centre_m) + tool[:3, 3]
        return cls(
            robot=robot.name,
            shape=shape,
            upright=upright_rotation(gravity),
            gravity_m_s2=gravity,
            joints=joints,
            links=tuple(links),
            small_links=tuple(small),
            tool=tool,
            plate=None if plate is None else _plate_pose(plate),
            payload_centre_m=centre,
        )

    @property
    def link_names(self) -> tuple[str, ...]:
        """Names of the links; each contains the name of the joint that moves the link."""
        moved = (f"link {i} ({joint.name})" for i, joint in enumerate(self.joints, start=1))
        return ("base", *moved)

    def placements(self, q: npt.ArrayLike) -> FloatArray:
        """Return the frames of base, links and tool in the base frame, (n + 2, 4, 4).

        Args:
            q: Shape (n,). Joint positions [rad or m].
        """
        frames = [np.eye(4)]
        for joint, position in zip(self.joints, np.asarray(q, dtype=np.float64), strict=True):
            frames.append(frames[-1] @ joint.pose(float(position)))
        return np.array([*frames, frames[-1] @ self.tool])


def upright_rotation(gravity: FloatArray) -> FloatArray:
    """Return the rotation (3, 3) from the base frame to the view, in which gravity is along -z.

    The view's x axis is the base's x axis, made horizontal. If gravity is within 8° of the base's
    x axis, it is the base's z axis instead. Without gravity, the view is the base frame.

    Args:
        gravity: Shape (3,). Acceleration of gravity in the base frame [m/s^2].
    """
    size = float(np.linalg.norm(gravity))
    if size < 1e-9:
        return np.eye(3)
    up = -gravity / size
    x = np.eye(3)[2 if abs(up[0]) > 0.99 else 0]
    x = x - (x @ up) * up
    x /= np.linalg.norm(x)
    return np.array([x, np.cross(up, x), up]) + 0.0  # no negative zeros


def _joints(robot: RobotDescription) -> tuple[SceneJoint, ...]:
    chain = Chain.from_description(robot)
    joints = []
    for joint, row, fixed in zip(robot.joints, chain.rows, chain.fixed_rotations, strict=True):
        _, _, theta_rad, a_m, d_m = row
        axis = np.array([0.0, 0.0, 1.0])
        origin = np.eye(4)
        origin[:3, :3] = fixed @ _rotation_about(axis, theta_rad)
        origin[:3, 3] = d_m * fixed[:, 2] + [a_m, 0.0, 0.0]
        limits = joint.limits.position_min, joint.limits.position_max
        joints.append(SceneJoint(joint.name, origin, axis, joint.type, limits))
    return tuple(joints)


def _plate_pose(plate: PlateConfig) -> FloatArray:
    pose = np.eye(4)
    pose[:3, :3] = rotation_of_rpy(*plate.rotation_rad)
    pose[:3, 3] = plate.position_m
    return pose


def _rotation_about(axis: FloatArray, angle_rad: float) -> FloatArray:
    """Return the rotation (3, 3) about a unit vector (Rodrigues)."""
    x, y, z = axis
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine, rest = np.sin(angle_rad), 1.0 - np.cos(angle_rad)
    return np.asarray(np.eye(3) + sine * across + rest * (across @ across))
