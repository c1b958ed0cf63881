"""`Chain`: the geometry of a serial arm as arrays, and its forward kinematics."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from config.arrays import BoolArray, FloatArray, IntArray
from config.errors import EstimationError
from config.formats.urdf import rotation_of_rpy
from config.robot.robot import RobotDescription

ChainArrays = tuple[FloatArray, FloatArray, BoolArray, FloatArray]


@dataclass(frozen=True, eq=False)
class Chain:
    """A serial chain of n joints in the modified Denavit-Hartenberg convention.

    Frame 0 is fixed to the base. Frame i is fixed to link i, and its z axis is the axis of joint i:
    the joint turns about it, or slides along it. Link parameters and rotor axes always refer to
    these frames, even if the robot file uses another convention.

    Attributes:
        rows: Shape (n, 5). alpha [rad], beta [rad], theta [rad], a [m], d [m] of the transform
            Rot_x(alpha) Trans_x(a) Rot_y(beta) Rot_z(theta) Trans_z(d) from frame i-1 to i (theory:
            section 1).
        prismatic: Shape (n,). True if the joint position adds to d, False if it adds to theta.
        gravity_m_s2: Shape (3,). Gravitational acceleration vector in the base frame [m/s^2].
        tool_m: Shape (3,). Tool point in the frame of the last link [m].

    Raises:
        EstimationError: An array has another shape, or there is no joint.
    """

    rows: FloatArray
    prismatic: BoolArray
    gravity_m_s2: FloatArray
    tool_m: FloatArray

    def __post_init__(self) -> None:
        arrays = (self.rows, self.prismatic, self.gravity_m_s2, self.tool_m)
        n = len(self.rows)
        shapes = [array.shape for array in arrays]
        if n == 0 or shapes != [(n, 5), (n,), (3,), (3,)]:
            raise EstimationError(
                "a chain needs arrays of the shapes (n, 5), (n,), (3,), (3,) for rows, prismatic,"
                f" gravity_m_s2, tool_m; got {', '.join(map(str, shapes))}",
                code="RID-API-ARGUMENT",
            )
        for array in arrays:
            array.setflags(write=False)

    @classmethod
    def from_description(cls, robot: RobotDescription) -> Chain:
        """Return the geometry of a robot description."""
        rows = robot.kinematics.modified_rows()
        tool = np.array(robot.tool_offset_m)
        if robot.kinematics.convention == "standard_dh":  # from axis n to the flange
            last = robot.kinematics.calibrated_rows[-1]
            tool = _rotation_x(last.alpha_rad) @ tool + np.array([last.a_m, 0.0, 0.0])
        return cls(
            rows=np.array([[r.alpha_rad, r.beta_rad, r.theta_rad, r.a_m, r.d_m] for r in rows]),
            prismatic=np.array([joint.type == "prismatic" for joint in robot.joints]),
            gravity_m_s2=np.array(robot.gravity_m_s2),
            tool_m=tool,
        )

    @property
    def n(self) -> int:
        """The number of joints."""
        return len(self.rows)

    @cached_property
    def fixed_rotations(self) -> FloatArray:
        """Constant part Rot_x(alpha) Rot_y(beta) of the rotation at every joint, (n, 3, 3)."""
        rotations = np.array([_rotation_x(row[0]) @ _rotation_y(row[1]) for row in self.rows])
        rotations.setflags(write=False)
        return rotations

    @property
    def arrays(self) -> ChainArrays:
        """The arrays for the kernels: rows, fixed_rotations, prismatic, gravity_m_s2."""
        return self.rows, self.fixed_rotations, self.prismatic, self.gravity_m_s2


def flange_pose(robot: RobotDescription) -> FloatArray:
    """Return the flange (the robot file's tool frame) in the frame of the last link, (4, 4)."""
    pose = np.eye(4)
    pose[:3, 3] = Chain.from_description(robot).tool_m
    pose[:3, :3] = rotation_of_rpy(*robot.tool_rpy_rad)
    if robot.kinematics.convention == "standard_dh":  # from axis n to the last frame of the table
        pose[:3, :3] = _rotation_x(robot.kinematics.calibrated_rows[-1].alpha_rad) @ pose[:3, :3]
    return pose


def link_transforms(chain: Chain, q: npt.ArrayLike) -> FloatArray:
    """Return the homogeneous transforms from all link frames to the base frame.

    Args:
        chain: The arm.
        q: Shape (samples, n). Joint positions [rad or m].

    Returns:
        Shape (samples, n, 4, 4). `T[s, i] @ (x, y, z, 1)` converts a point from frame i+1 to the
        base frame.

    Raises:
        EstimationError: q does not have the shape (samples, n).
    """
    position = np.asarray(q, dtype=np.float64)
    if position.ndim != 2 or position.shape[1] != chain.n:
        raise EstimationError(
            f"joint positions must have the shape (samples, {chain.n}), got {position.shape}",
            code="RID-API-ARGUMENT",
        )
    theta = chain.rows[:, 2] + np.where(chain.prismatic, 0.0, position)
    d = chain.rows[:, 4] + np.where(chain.prismatic, position, 0.0)
    fixed = chain.fixed_rotations
    cos, sin = np.cos(theta)[..., None], np.sin(theta)[..., None]

    step = np.zeros((*position.shape, 4, 4))
    step[..., :3, 0] = cos * fixed[:, :, 0] + sin * fixed[:, :, 1]
    step[..., :3, 1] = cos * fixed[:, :, 1] - sin * fixed[:, :, 0]
    step[..., :3, 2] = fixed[:, :, 2]
    step[..., :3, 3] = d[..., None] * fixed[:, :, 2]
    step[..., 0, 3] += chain.rows[:, 3]
    step[..., 3, 3] = 1.0
    for i in range(1, chain.n):
        step[:, i] = step[:, i - 1] @ step[:, i]
    return step


def forward(chain: Chain, q: npt.ArrayLike) -> FloatArray:
    """Return the tool point in the base frame [m], (samples, 3), for q of shape (samples, n).

    Raises:
        EstimationError: q does not have the shape (samples, n).
    """
    last = link_transforms(chain, q)[:, -1]
    tool: FloatArray = last[:, :3, :3] @ chain.tool_m + last[:, :3, 3]
    return tool


def jacobian(chain: Chain, q: npt.ArrayLike) -> FloatArray:
    """Return the geometric Jacobian of the tool point.

    Args:
        chain: The arm.
        q: Shape (samples, n). Joint positions [rad or m].

    Returns:
        Shape (samples, 6, n). Linear velocity of the tool point, then angular velocity of the last
        link, in the base frame, per unit velocity of each joint.

    Raises:
        EstimationError: q does not have the shape (samples, n).
    """
    transforms = link_transforms(chain, q)
    last = transforms[:, -1]
    tool = last[:, :3, :3] @ chain.tool_m + last[:, :3, 3]
    axes = np.where(chain.prismatic[:, np.newaxis], 0.0, transforms[:, :, :3, 2])
    links = np.full(len(tool), chain.n)
    out = np.empty((len(tool), 6, chain.n))
    out[:, :3] = point_jacobian(chain, transforms, links, tool)
    out[:, 3:] = axes.transpose(0, 2, 1)
    return out


def point_jacobian(
    chain: Chain, transforms: FloatArray, links: IntArray, points_m: FloatArray
) -> FloatArray:
    """Return the Jacobian of points that are fixed to links.

    Args:
        chain: The arm.
        transforms: Shape (samples, n, 4, 4). Poses of the links, from `link_transforms`.
        links: Shape (samples,). The link that carries each point, 0 for the base.
        points_m: Shape (samples, 3). The points, in the base frame.

    Returns:
        Shape (samples, 3, n). Velocity of the points in the base frame, per unit velocity of each
        joint.
    """
    axes, origins = transforms[:, :, :3, 2], transforms[:, :, :3, 3]
    turning = np.cross(axes, points_m[:, np.newaxis] - origins)
    moving = np.where(chain.prismatic[:, np.newaxis], axes, turning)
    moves = np.arange(1, chain.n + 1) <= np.asarray(links)[:, np.newaxis]
    return np.asarray((moving * moves[:, :, np.newaxis]).transpose(0, 2, 1))


def _rotation_x(angle: float) -> FloatArray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def _rotation_y(angle: float) -> FloatArray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
