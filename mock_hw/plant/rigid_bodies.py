"""The simulated robot's rigid bodies in Pinocchio: links, and every rotor as a separate body.

The coordinates of the full model are those of the n joints, and of the rotor of each joint that has
one. A rotor is a body that turns about its axis on the link that carries it. The gears couple these
coordinates to those of the n actuators:
q_full = G alpha, with the constant matrix G = [C; diag(mu)]. C converts actuator positions to joint
positions (5.18) and is the identity if the robot has no coupled wrist; mu are the gear ratios. With
the full model's mass matrix M and bias b, the reduced equations have the mass matrix Gᵀ M G and the
bias Gᵀ b. They contain the coupling of rotors and links (theory: section 3) and that of the wrist
(5.19) without explicit formulas. A joint with `armature` has a rotor that no link carries: it turns
in the world frame.

If a gear is elastic (`joint_stiffness_nm_rad`), the motor and the gear's output are two separate
coordinates. The motor has the column of its axis in G, by which it then moves only its rotor. The
gear's output has an additional column after those of all axes, and moves the links.

For the base wrench, the base is on a free joint that does not move; the wrench is the generalised
force of this joint.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from numpy.typing import NDArray

from config.errors import ConfigError
from config.quantities import Vector3
from config.robot.kinematic_table import KinematicRow
from config.robot.robot import RobotDescription
from config.simulation.plant import LinkInertia, PlantConfig

Vector = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True)
class GearedModel:
    """Pinocchio model of links and rotors, with the matrix G that couples them to the actuators.

    Attributes:
        model: Pinocchio model with one coordinate per joint and one per rotor, m in total.
        gearing: Shape (m, n + f). Matrix G: the velocities of the model's coordinates are G times
            the velocities of the n motors and of the f outputs of elastic gears. Without elastic
            gears and coupling, the motors' velocities are those of the joints.
    """

    model: Any
    gearing: Vector

    def entries(self) -> tuple[Indices, Indices, Vector]:
        """Return row (coordinate), column (actuator) and value of every nonzero entry of G."""
        coordinate, actuator = np.nonzero(self.gearing)
        return coordinate, actuator, self.gearing[coordinate, actuator]


def output_columns(plant: PlantConfig) -> Indices:
    """Return each gear output's column in G, (n,); for a rigid gear, it is the motor's column."""
    columns = np.arange(len(plant.axes))
    giving = [extra.joint_stiffness_nm_rad is not None for extra in plant.extras]
    columns[giving] = len(columns) + np.arange(sum(giving))
    return columns


def build_rigid_bodies(
    robot: RobotDescription, plant: PlantConfig, *, floating: bool = False
) -> GearedModel:
    """Return the model of a robot with the plant's inertias and, if stated, its true kinematics.

    A payload that is mounted in the plant is a rigid part of the last link.

    Args:
        floating: True to put the base on a free joint, for `BaseWrench`.

    Raises:
        ConfigError: Plant and robot do not fit each other.
    """
    count = len(robot.joints)
    _check(robot, plant)
    joints = _joints(robot, plant)
    model: Any = pin.Model()
    model.gravity.linear = np.array(robot.gravity_m_s2)
    parent = 0
    if floating:
        parent = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    outputs = output_columns(plant)
    width = max(count, *(outputs + 1))
    motors = np.eye(count, width)
    joint_of = np.zeros((count, width))
    joint_of[:, outputs] = np.eye(count) if robot.coupling is None else np.array(robot.coupling)
    gearing: list[Vector] = []
    # Pinocchio requires this order: a link, its rotors, then the next link.
    for number in range(count + 1):
        if number > 0:
            parent = model.addJoint(parent, *joints[number - 1])
            model.appendBodyToJoint(parent, _inertia(plant.links[number - 1]), pin.SE3.Identity())
            if number == count and plant.attached is not None:
                payload = plant.payloads[plant.attached]
                model.appendBodyToJoint(parent, _inertia(payload), pin.SE3.Identity())
            gearing.append(joint_of[number - 1])
        for index, joint in enumerate(robot.joints):
            if joint.rotor is not None and joint.rotor.link == number:
                inertia = plant.axes[index].rotor_inertia_kg_m2
                _add_rotor(model, parent, joint.rotor.axis, inertia, f"{joint.name}-rotor")
                gearing.append(joint.gear_ratio * motors[index])
    for index, (joint, axis) in enumerate(zip(robot.joints, plant.axes, strict=True)):
        if joint.armature:
            name = f"{joint.name}-armature"
            _add_rotor(model, 0, (0.0, 0.0, 1.0), axis.rotor_inertia_kg_m2, name)
            gearing.append(joint.gear_ratio * motors[index])
    return GearedModel(model, np.array(gearing))


def last_body(robot: RobotDescription, plant: PlantConfig, payload: str | None) -> Vector:
    """Return the ten inertial parameters of the last link with a payload, in Pinocchio's order.

    They are linear in the bodies: parameters of a part of the payload are a weighted mean.
    """
    found = np.array(_inertia(plant.links[len(robot.joints) - 1]).toDynamicParameters())
    if payload is not None:
        found += _inertia(plant.payloads[payload]).toDynamicParameters()
    return found


def set_last_body(model: Any, robot: RobotDescription, parameters: Vector) -> None:
    """Set the inertial parameters of the last link in a model, as returned by `last_body`."""
    number = model.getJointId(robot.joints[-1].name)
    model.inertias[number] = pin.Inertia.FromDynamicParameters(parameters)


def build_links(robot: RobotDescription, plant: PlantConfig) -> Any:
    """Return a Pinocchio model of the true kinematics: n joints, without bodies and rotors.

    Raises:
        ConfigError: Plant and robot do not fit each other.
    """
    _check(robot, plant)
    model: Any = pin.Model()
    parent = 0
    for joint in _joints(robot, plant):
        parent = model.addJoint(parent, *joint)
    return model


class BaseWrench:
    """Computes the wrench of the base on a robot from the motion of its actuators.

    By the laws of Newton and Euler, it is the rate of change of the momentum of the whole robot,
    including its rotors, minus the gravity wrench. Forces between the robot's bodies, such as motor
    torques, friction and springs, have no effect.

    Args:
        robot: As for `build_rigid_bodies`.
        plant: As for `build_rigid_bodies`.
    """

    def __init__(self, robot: RobotDescription, plant: PlantConfig) -> None:
        self._robot = robot
        bodies = build_rigid_bodies(robot, plant, floating=True)
        self._model = bodies.model
        self._data: Any = self._model.createData()
        self._gearing = bodies.gearing
        self._position: Vector = np.array(pin.neutral(self._model))
        self._velocity: Vector = np.zeros(self._model.nv)
        self._acceleration: Vector = np.zeros(self._model.nv)
        # The first entries of each vector belong to the free joint, which does not move.
        count = len(self._gearing)
        self._own = tuple(
            full[-count:] for full in (self._position, self._velocity, self._acceleration)
        )

    def __call__(self, motion: Vector) -> Vector:
        """Return the wrench (6,): force [N], then moment [N m] about the origin of frame 0.

        Args:
            motion: Shape (3, n + f). Positions, velocities and accelerations of the n motors and f
                gear outputs.
        """
        for own, full in zip(self._own, motion @ self._gearing.T, strict=True):
            own[:] = full
        forces = pin.rnea(
            self._model, self._data, self._position, self._velocity, self._acceleration
        )
        return np.array(forces[:6])

    def set_last_body(self, parameters: Vector) -> None:
        """Set the inertial parameters of the last link, as returned by `last_body`."""
        set_last_body(self._model, self._robot, parameters)

    def over_step(self, before: Vector, after: Vector, step_s: float) -> Vector:
        """Return the wrench (6,) in the middle of a step, with the mean acceleration of the step.

        Args:
            before: Shape (2, n + f). Positions and velocities of the n motors and f gear outputs at
                the start.
            after: Shape (2, n + f). Positions and velocities at the end.
            step_s: Duration of the step [s].
        """
        motion = np.array([*(0.5 * (before + after)), (after[1] - before[1]) / step_s])
        return self(motion)


def _joints(robot: RobotDescription, plant: PlantConfig) -> list[tuple[Any, Any, str]]:
    """Return kind, true placement and name of each joint, base to flange."""
    kinematics = robot.kinematics
    if plant.unmodelled is not None and plant.unmodelled.kinematics is not None:
        kinematics = plant.unmodelled.kinematics
    return [
        (
            pin.JointModelRZ() if joint.type == "revolute" else pin.JointModelPZ(),
            _joint_placement(row),
            joint.name,
        )
        for joint, row in zip(robot.joints, kinematics.modified_rows(), strict=True)
    ]


def _add_rotor(model: Any, carrier: int, axis: Vector3, inertia_kg_m2: float, name: str) -> None:
    """Add a body that has only a polar inertia, and turns about an axis fixed to its carrier."""
    spin = np.array(axis)
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
                f" {len(robot.joints)} joints",
                code="RID-PLANT-UNFIT",
            )
    if (robot.spring is None) != (plant.spring is None):
        raise ConfigError(
            f"plant {plant.name!r} and robot {robot.name!r}: only one of the two files has"
            " `spring`; both need it or neither",
            code="RID-PLANT-UNFIT",
        )
    for joint, axis in zip(robot.joints, plant.axes, strict=True):
        if joint.rotor is None and not joint.armature and axis.rotor_inertia_kg_m2 > 0.0:
            raise ConfigError(
                f"plant {plant.name!r} has a rotor inertia for joint {joint.name!r}, but robot"
                f" {robot.name!r} does not describe the position of its rotor: add `rotor`, or"
                " `armature: true`, to that joint, or set rotor_inertia_kg_m2 to 0",
                code="RID-PLANT-UNFIT",
            )


def _joint_placement(row: KinematicRow) -> Any:
    """Return Rot_x(alpha) Trans_x(a) Rot_y(beta) Rot_z(theta) Trans_z(d) of a joint."""
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
