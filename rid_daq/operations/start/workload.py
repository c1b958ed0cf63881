"""`Workload`: what a robot's motors have to move and to hold; limits such that they can."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.motion.kinds.multipoint import MultipointMotion
from config.arrays import FloatArray
from config.robot.robot import Joint, RobotDescription
from dynamics.model.cad import cad_parameters
from dynamics.model.inverse_dynamics import mass_matrix
from dynamics.model.robot_model import RobotModel, torque

POSES: Final = 300
VALIDATION_POINTS: Final = 12
SAMPLE_S: Final = 0.02
TORQUE_SHARE: Final = 0.8
"""Share of the torque limits for links and rotors; friction and control take the rest."""
GRAVITY_SHARE: Final = 0.6
"""Share of the torque limits that gravity may take, so that something is left to move with."""
LEAST_CROSSING_S: Final = 0.5
"""In which no joint may cross its range: it must come to rest within it after a fault."""
INTEGRAL_TIME_S: Final = 0.04
SOFTEST_LOOP_RAD_S: Final = 60.0
FASTEST_LOOP_RAD_S: Final = 600.0
ERROR_AT_LIMIT_RAD: Final = 0.02
ERROR_AT_LIMIT_M: Final = 0.005
"""How far the torque limit pushes a joint off its set-point: what the velocity loop integrates."""


@dataclass(frozen=True, eq=False)
class Workload:
    """A robot's drawings in random poses.

    Attributes:
        inertia: Shape (n,). The largest inertia of the links about each joint [kg m² or kg].
        gravity_nm: Shape (n,). The largest torque at rest [N m or N].
    """

    inertia: FloatArray
    gravity_nm: FloatArray

    @classmethod
    def of(cls, robot: RobotDescription) -> Workload:
        """Take a robot's `cad` and its range; the same robot gives the same poses.

        Raises:
            ConfigError: The robot has no `cad`.
        """
        model, values = _links(robot)
        limits = [joint.limits for joint in robot.joints]
        low, high = ([getattr(x, f"position_{end}") for x in limits] for end in ("min", "max"))
        q = np.random.default_rng(0).uniform(low, high, (POSES, len(limits)))
        rest = np.zeros_like(q)
        mass = mass_matrix(model, q, values)
        return cls(
            inertia=np.asarray(np.diagonal(mass, axis1=1, axis2=2).max(axis=0)),
            gravity_nm=np.asarray(np.abs(torque(model, q, rest, rest, values)).max(axis=0)),
        )

    def gains(self, robot: RobotDescription) -> FloatArray:
        """Return gains of the velocity loops, (n,) [N m s/rad or N s/m].

        As stiff as the torque limit asks, and fast enough for the largest inertia about the joint,
        rotor included.
        """
        errors = [
            ERROR_AT_LIMIT_M if joint.type == "prismatic" else ERROR_AT_LIMIT_RAD
            for joint in robot.joints
        ]
        stiff = INTEGRAL_TIME_S * _torque_limits(robot) / errors
        fast = self.inertia / (1.0 / SOFTEST_LOOP_RAD_S - 1.0 / FASTEST_LOOP_RAD_S)
        return np.maximum(stiff, fast)

    def rotors(self, robot: RobotDescription) -> FloatArray:
        """Return inertias of the rotors at the link side, (n,) [kg m² or kg].

        Heavy enough that no loop is too fast where the other joints give way: with gains K and
        rotors K / `FASTEST_LOOP_RAD_S` no eigenvalue of (M + I)⁻¹ K is above that, whatever the
        links' M, and so nothing has to be known of the coupling between the joints.
        """
        return self.gains(robot) / FASTEST_LOOP_RAD_S


def validation_motion(robot: RobotDescription) -> MultipointMotion:
    """Return the random points that a model is validated with."""
    return MultipointMotion(kind="multipoint", robot=robot.name, points=VALIDATION_POINTS, seed=1)


def held_by_motors(robot: RobotDescription) -> tuple[RobotDescription, tuple[str, ...]]:
    """Return the robot with limits that its motors hold, and what was changed, in words.

    A torque limit below what gravity takes is raised. A joint that would run through its whole
    range before anything stopped it is slowed down. Where the validation motion takes more torque
    than there is, speed and acceleration of all joints are lowered together, so that its path is
    the same: every torque but gravity's goes with the square of the speed.

    Raises:
        ConfigError: The robot has no `cad`, or its bodies leave no room for the validation motion.
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
        fastest = (joint.limits.position_max - joint.limits.position_min) / LEAST_CROSSING_S
        if joint.limits.velocity > fastest:
            notes.append(
                f"joint {joint.name!r}: limits.velocity {joint.limits.velocity:g} crosses its range"
                f" in less than {LEAST_CROSSING_S:g} s, before a fault would stop it:"
                f" {fastest:.3g} is taken"
            )
            joint = _with_limits(joint, velocity=float(f"{fastest:.3g}"))
        joints.append(joint)
    robot = robot.model_copy(update={"joints": tuple(joints)})
    room = _room(robot, load)
    tightest = int(np.argmin(room))
    if room[tightest] >= 1.0:
        return robot, tuple(notes)
    speed = float(np.floor(100.0 * np.sqrt(room[tightest])) / 100.0)
    joint = joints[tightest]
    notes.append(
        f"speeds are {speed:g} of what they were, accelerations in proportion: the torque of joint"
        f" {joint.name!r}, {joint.limits.torque:g} {_unit(joint)}, does not move the links through"
        " the validation motion any faster"
    )
    return slower(robot, speed), tuple(notes)


def slower(robot: RobotDescription, speed: float) -> RobotDescription:
    """Return the robot with its speeds times a factor, its accelerations times the square of it."""
    joints = tuple(
        _with_limits(
            joint,
            velocity=joint.limits.velocity * speed,
            acceleration=joint.limits.acceleration * speed**2,
        )
        for joint in robot.joints
    )
    return robot.model_copy(update={"joints": joints})


def _room(robot: RobotDescription, load: Workload) -> FloatArray:
    """Return how many times what moves may take as much in the validation motion, (n,)."""
    model, values = _links(robot)
    motion = validation_motion(robot).plan(robot, SAMPLE_S)
    q, v, a = motion.position, motion.velocity, motion.acceleration
    rest = np.zeros_like(q)
    gravity = torque(model, q, rest, rest, values)
    moving = torque(model, q, v, a, values) - gravity + load.rotors(robot) * a
    left = TORQUE_SHARE * _torque_limits(robot) - np.sign(moving) * gravity
    return np.asarray((left / np.maximum(np.abs(moving), 1e-12)).min(axis=0))


def _links(robot: RobotDescription) -> tuple[RobotModel, FloatArray]:
    model = RobotModel.from_description(robot, rotors=False, friction=False, spring=False)
    return model, cad_parameters(model, robot)[0]


def _torque_limits(robot: RobotDescription) -> FloatArray:
    return np.array([joint.limits.torque for joint in robot.joints])


def _with_limits(joint: Joint, **values: float) -> Joint:
    rounded = {name: float(f"{value:.6g}") for name, value in values.items()}
    return joint.model_copy(update={"limits": joint.limits.model_copy(update=rounded)})


def _unit(joint: Joint) -> str:
    return "N" if joint.type == "prismatic" else "N m"


def _two_digits(value: float) -> float:
    """Return the value with two digits, rounded upwards."""
    step = 10.0 ** (np.floor(np.log10(value)) - 1.0)
    return float(f"{np.ceil(value / step) * step:.2g}")
