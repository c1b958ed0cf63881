"""`Workload`: what a robot's motors have to move and to hold, over its workspace and its limits.

`held_by_motors` makes the limits such that they can.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.robot.robot import Joint, RobotDescription
from dynamics.model.cad import cad_parameters
from dynamics.model.inverse_dynamics import mass_matrix
from dynamics.model.robot_model import RobotModel, torque

POSES: Final = 300
MOTION_SHARE: Final = 0.7
"""Share of speed and acceleration that every motion must be possible with: a validation's."""
TORQUE_SHARE: Final = 0.8
"""Share of the torque limits for the links; friction and rotors take the rest."""
GRAVITY_SHARE: Final = 0.6
"""Share of the torque limits that gravity may take, so that something is left to move with."""


@dataclass(frozen=True, eq=False)
class Workload:
    """A robot's drawings in random poses, and in motion at `MOTION_SHARE` of its limits.

    Attributes
    ----------
    inertia : (n,) array
        The largest inertia about each joint, without rotors [kg m² or kg].
    gravity_nm : (n,) array
        The largest torque at rest [N m or N].
    motion_nm : (n,) array
        The largest torque that speed and acceleration can add to it [N m or N].
    """

    inertia: FloatArray
    gravity_nm: FloatArray
    motion_nm: FloatArray

    @classmethod
    def of(cls, robot: RobotDescription) -> Workload:
        """Take a robot's `cad` and its limits; the same robot gives the same poses.

        Raises
        ------
        ConfigError
            The robot has no `cad`.
        """
        model = RobotModel.from_description(robot, rotors=False, friction=False, spring=False)
        values, _ = cad_parameters(model, robot)
        limits = [joint.limits for joint in robot.joints]
        random = np.random.default_rng(0)
        shape = (POSES, len(limits))
        low, high = ([getattr(x, f"position_{end}") for x in limits] for end in ("min", "max"))
        q = random.uniform(low, high, shape)
        v = random.choice((-MOTION_SHARE, MOTION_SHARE), shape) * [x.velocity for x in limits]
        a = MOTION_SHARE * np.array([x.acceleration for x in limits])
        rest = np.zeros(shape)
        gravity = torque(model, q, rest, rest, values)
        speed = np.abs(torque(model, q, v, rest, values) - gravity)
        mass = mass_matrix(model, q, values)
        return cls(
            inertia=np.asarray(np.diagonal(mass, axis1=1, axis2=2).max(axis=0)),
            gravity_nm=np.asarray(np.abs(gravity).max(axis=0)),
            motion_nm=np.asarray((speed + np.abs(mass) @ a).max(axis=0)),
        )


def held_by_motors(robot: RobotDescription) -> tuple[RobotDescription, tuple[str, ...]]:
    """Return the robot with limits that its motors hold, and what was changed, in words.

    A torque limit below what gravity takes is raised. Where the links take more torque than there
    is, speed and acceleration of all joints are lowered together, in the same path: every torque
    but gravity's goes with the square of the speed.

    Raises
    ------
    ConfigError
        The robot has no `cad`.
    """
    load = Workload.of(robot)
    notes: list[str] = []
    joints = []
    for joint, gravity in zip(robot.joints, load.gravity_nm.tolist(), strict=True):
        least = gravity / GRAVITY_SHARE
        if joint.limits.torque < least:
            raised = _two_digits(least)
            notes.append(
                f"joint {joint.name!r}: gravity takes up to {gravity:.3g} {_unit(joint)},"
                f" limits.torque {joint.limits.torque:g} leaves too little to move with:"
                f" {raised:g} {_unit(joint)} is taken; correct it, or narrow its range"
            )
            joint = _with_limits(joint, torque=raised)
        joints.append(joint)
    limits = np.array([joint.limits.torque for joint in joints])
    room = (TORQUE_SHARE * limits - load.gravity_nm) / np.maximum(load.motion_nm, 1e-12)
    tightest = int(np.argmin(room))
    if room[tightest] < 1.0:
        speed = float(np.floor(100.0 * np.sqrt(room[tightest])) / 100.0)
        notes.append(
            f"speeds are {speed:g} of the URDF's, accelerations in proportion: the torque of joint"
            f" {joints[tightest].name!r}, {limits[tightest]:g} {_unit(joints[tightest])}, does not"
            " move the links faster in every pose; raise them where motions are checked for torque"
        )
        joints = [
            _with_limits(
                joint,
                velocity=joint.limits.velocity * speed,
                acceleration=joint.limits.acceleration * speed**2,
            )
            for joint in joints
        ]
    return robot.model_copy(update={"joints": tuple(joints)}), tuple(notes)


def _with_limits(joint: Joint, **values: float) -> Joint:
    rounded = {name: float(f"{value:.6g}") for name, value in values.items()}
    return joint.model_copy(update={"limits": joint.limits.model_copy(update=rounded)})


def _unit(joint: Joint) -> str:
    return "N" if joint.type == "prismatic" else "N m"


def _two_digits(value: float) -> float:
    """Return the value with two digits, rounded upwards."""
    step = 10.0 ** (np.floor(np.log10(value)) - 1.0)
    return float(f"{np.ceil(value / step) * step:.2g}")
