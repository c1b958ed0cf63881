"""The simulated robot's rigid bodies in Pinocchio: links, and every rotor as a body of its own.

A rotor turns in the full model of 2n coordinates about its axis on the link that carries it; its
gear ties it to its joint, q_full = G q with G = [1; diag(mu)] constant. The reduced equations are
Gᵀ M G and Gᵀ b: the rotors' coupling (physics: section 3) follows without a formula for it.

What holds the base still is the generalised force of a free joint under it that does not move.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from numpy.typing import NDArray

from config.errors import ConfigError
from config.plant import LinkInertia, PlantConfig
from config.robot import KinematicRow, RobotDescription, Rotor

Vector = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True)
class RigidBodies:
    """A Pinocchio model of links and rotors, and how its coordinates hang on the joints.

    Attributes
    ----------
    model : pinocchio.Model
        One coordinate a joint and one a rotor, m in all.
    coordinate_joint : (m,) int64
        The joint that moves each coordinate.
    coordinate_ratio : (m,) float64
        Coordinate velocity over joint velocity: 1 for joints, the gear ratio for rotors.
    floating
        Whether a free joint under the base comes before these coordinates in the model.
    """

    model: Any
    coordinate_joint: Indices
    coordinate_ratio: Vector
    floating: bool = False

    @property
    def joints(self) -> int:
        """Number of joints."""
        return int(self.coordinate_joint.max()) + 1

    def coupling(self) -> Vector:
        """Return G, (m, n): coordinate velocities are G times joint velocities."""
        matrix = np.zeros((len(self.coordinate_joint), self.joints))
        matrix[np.arange(len(self.coordinate_joint)), self.coordinate_joint] = self.coordinate_ratio
        return matrix


def build_rigid_bodies(
    robot: RobotDescription, plant: PlantConfig, *, floating: bool = False
) -> RigidBodies:
    """Build the model of a robot with the plant's inertias and, where given, true kinematics.

    With `floating`, the base stands on a free joint: see `BaseWrench`.

    Raises
    ------
    ConfigError
        Where plant and robot do not fit each other.
    """
    count = len(robot.joints)
    _check(robot, plant)
    kinematics = robot.kinematics
    if plant.unmodelled is not None and plant.unmodelled.kinematics is not None:
        kinematics = plant.unmodelled.kinematics
    model: Any = pin.Model()
    model.gravity.linear = np.array(robot.gravity_m_s2)
    parent = 0
    if floating:
        parent = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    moving: list[int] = []
    ratios: list[float] = []
    # Pinocchio wants every subtree in one piece: a link, then its rotors, then the next link.
    for number in range(count + 1):
        if number > 0:
            joint, row = robot.joints[number - 1], kinematics.modified_rows()[number - 1]
            kind = pin.JointModelRZ() if joint.type == "revolute" else pin.JointModelPZ()
            parent = model.addJoint(parent, kind, _placement(row), joint.name)
            model.appendBodyToJoint(parent, _inertia(plant.links[number - 1]), pin.SE3.Identity())
            moving.append(number - 1)
            ratios.append(1.0)
        for index, joint in enumerate(robot.joints):
            if joint.rotor is not None and joint.rotor.link == number:
                inertia = plant.axes[index].rotor_inertia_kg_m2
                _add_rotor(model, parent, joint.rotor, inertia, f"{joint.name}-rotor")
                moving.append(index)
                ratios.append(joint.gear_ratio)
    return RigidBodies(model, np.array(moving, dtype=np.int64), np.array(ratios), floating)


class BaseWrench:
    """The wrench that the base exerts on a robot, for any motion of its joints.

    By Newton and Euler it is the change of the whole robot's momentum, every rotor's spin
    included, less its weight. What acts between the robot's bodies (motor torques, friction,
    springs) does not occur in it.

    Parameters
    ----------
    robot, plant
        As for `build_rigid_bodies`.
    """

    def __init__(self, robot: RobotDescription, plant: PlantConfig) -> None:
        bodies = build_rigid_bodies(robot, plant, floating=True)
        self._model = bodies.model
        self._data: Any = self._model.createData()
        self._joint = bodies.coordinate_joint
        self._ratio = bodies.coordinate_ratio
        self._position: Vector = np.array(pin.neutral(self._model))
        self._velocity: Vector = np.zeros(self._model.nv)
        self._acceleration: Vector = np.zeros(self._model.nv)

    def __call__(self, motion: Vector) -> Vector:
        """Return the wrench (6,): force [N], then moment [N m] about the origin of frame 0.

        Parameters
        ----------
        motion : (3, n)
            The joints' positions, velocities and accelerations.
        """
        full = motion[:, self._joint] * self._ratio
        self._position[-len(self._joint) :] = full[0]
        self._velocity[-len(self._joint) :] = full[1]
        self._acceleration[-len(self._joint) :] = full[2]
        forces = pin.rnea(
            self._model, self._data, self._position, self._velocity, self._acceleration
        )
        return np.array(forces[:6])


def _add_rotor(model: Any, carrier: int, rotor: Rotor, inertia_kg_m2: float, name: str) -> None:
    """Add a body of polar inertia alone, turning about its axis on the carrier's frame."""
    spin = np.array(rotor.axis)
    identity = pin.SE3.Identity()
    number = model.addJoint(carrier, pin.JointModelRevoluteUnaligned(spin), identity, name)
    body = pin.Inertia(0.0, np.zeros(3), inertia_kg_m2 * np.outer(spin, spin))
    model.appendBodyToJoint(number, body, identity)


def _check(robot: RobotDescription, plant: PlantConfig) -> None:
    counts = {"links": len(plant.links), "axes": len(plant.axes)}
    if plant.unmodelled is not None:
        counts["unmodelled.axes"] = len(plant.unmodelled.axes)
        if plant.unmodelled.kinematics is not None:
            counts["unmodelled.kinematics.rows"] = len(plant.unmodelled.kinematics.rows)
    for what, number in counts.items():
        if number != len(robot.joints):
            raise ConfigError(
                f"plant {plant.name!r}: {what} has {number} entries, but robot {robot.name!r} has"
                f" {len(robot.joints)} joints"
            )
    if (robot.spring is None) != (plant.spring is None):
        raise ConfigError(
            f"plant {plant.name!r} and robot {robot.name!r}: `spring` must stand in both or in"
            " neither"
        )
    for joint, axis in zip(robot.joints, plant.axes, strict=True):
        if joint.rotor is None and axis.rotor_inertia_kg_m2 > 0.0:
            raise ConfigError(
                f"plant {plant.name!r} gives joint {joint.name!r} a rotor inertia, but robot"
                f" {robot.name!r} does not say where its rotor sits: add `rotor` to that joint, or"
                " set rotor_inertia_kg_m2 to 0"
            )


def _placement(row: KinematicRow) -> Any:
    """Rot_x(alpha) Trans_x(a) Rot_y(beta) Rot_z(theta) Trans_z(d); the joint is at its end."""
    turn = (
        pin.utils.rotate("x", row.alpha_rad)
        @ pin.utils.rotate("y", row.beta_rad)
        @ pin.utils.rotate("z", row.theta_rad)
    )
    shift = np.array([row.a_m, 0.0, 0.0]) + turn @ np.array([0.0, 0.0, row.d_m])
    return pin.SE3(turn, shift)


def _inertia(link: LinkInertia) -> Any:
    xx, yy, zz, xy, xz, yz = link.inertia_kg_m2
    about_centre = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return pin.Inertia(link.mass_kg, np.array(link.centre_m), about_centre)
