"""`Workload`: inertia and gravity that a robot's motors must move.

It also computes limits that the motors can keep.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.motion.kinds.multipoint import CLEARANCE_M, MultipointMotion, straight_line
from config.arrays import FloatArray
from config.robot.bodies import Workspace
from config.robot.robot import Joint, RobotDescription
from dynamics.geometry.clearances import Clearances
from dynamics.model.cad import cad_parameters
from dynamics.model.inverse_dynamics import mass_matrix
from dynamics.model.robot_model import RobotModel, torque

POSES: Final = 300
VALIDATION_POINTS: Final = 12
MOST_SEEDS: Final = 100
SAMPLE_S: Final = 0.02
TORQUE_SHARE: Final = 0.8
"""Fraction of the torque limits for links and rotors; friction and control use the rest."""
GRAVITY_SHARE: Final = 0.6
"""Largest fraction of the torque limits for gravity; motion needs the rest."""
LEAST_CROSSING_S: Final = 0.5
"""Shortest time [s] in which a joint may cross its range, so that a fault stops it in time."""
INTEGRAL_TIME_S: Final = 0.04
SOFTEST_LOOP_RAD_S: Final = 60.0
FASTEST_LOOP_RAD_S: Final = 600.0
ERROR_AT_LIMIT_RAD: Final = 0.02
ERROR_AT_LIMIT_M: Final = 0.005
"""Position errors at which the integral part of a velocity loop reaches the torque limit."""


@dataclass(frozen=True, eq=False)
class Workload:
    """Largest loads of a robot's joints in random poses, from its CAD data.

    Attributes:
        inertia: Shape (n,). Largest inertia of the links at each motor, link side [kg m² or kg].
        gravity_nm: Shape (n,). Largest torque at rest [N m or N].
    """

    inertia: FloatArray
    gravity_nm: FloatArray

    @classmethod
    def of(cls, robot: RobotDescription) -> Workload:
        """Compute the largest loads over random poses within the limits, from a robot's `cad`.

        Every call uses the same poses.

        Raises:
            ConfigError: The robot has no `cad`.
        """
        model, values = _link_model(robot)
        limits = [joint.limits for joint in robot.joints]
        low, high = ([getattr(x, f"position_{end}") for x in limits] for end in ("min", "max"))
        q = np.random.default_rng(0).uniform(low, high, (POSES, len(limits)))
        rest = np.zeros_like(q)
        mass = mass_matrix(model, q, values)
        if model.coupling is not None:
            joints_by_motors = model.coupling.joints_by_motors
            mass = joints_by_motors.T @ mass @ joints_by_motors
        return cls(
            inertia=np.asarray(np.diagonal(mass, axis1=1, axis2=2).max(axis=0)),
            gravity_nm=np.asarray(np.abs(torque(model, q, rest, rest, values)).max(axis=0)),
        )

    def gains(self, robot: RobotDescription) -> FloatArray:
        """Return gains of the velocity loops, (n,) [N m s/rad or N s/m].

        A gain is large enough that the integral part of the loop reaches the torque limit at a
        position error of `ERROR_AT_LIMIT_RAD` (prismatic joints: `ERROR_AT_LIMIT_M`). The gain is
        also large enough that the loop reaches `SOFTEST_LOOP_RAD_S` with the largest inertia about
        the joint, rotor included.
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

        They are heavy enough that no loop is too fast if the other joints move freely: with gains K
        and rotors I = K / `FASTEST_LOOP_RAD_S`, no eigenvalue of (M + I)⁻¹ K exceeds
        `FASTEST_LOOP_RAD_S` for any mass matrix M of the links. The coupling between the joints
        therefore need not be known.
        """
        return self.gains(robot) / FASTEST_LOOP_RAD_S


def zero_pose(robot: RobotDescription) -> FloatArray:
    """Return joint position 0, or mid-range for a joint whose range excludes 0, (n,) [rad or m]."""
    limits = [joint.limits for joint in robot.joints]
    ends = np.array([(each.position_min, each.position_max) for each in limits])
    inside = (ends[:, 0] < 0.0) & (ends[:, 1] > 0.0)
    return np.where(inside, 0.0, ends.mean(axis=1))


def validation_motion(robot: RobotDescription) -> MultipointMotion:
    """Return a motion through random points for the validation of a model.

    Its seed is the first one whose first point can be reached from the zero pose, in which the
    simulated robot starts. The seed is 1 if no seed up to `MOST_SEEDS` gives such a point, or if
    bodies are too close in the zero pose.
    """
    clearances = Clearances.of(robot, Workspace(clearance_m=CLEARANCE_M))
    start = zero_pose(robot)
    motions = [
        MultipointMotion(kind="multipoint", robot=robot.name, points=VALIDATION_POINTS, seed=seed)
        for seed in range(1, MOST_SEEDS + 1)
    ]
    if not clearances.is_clear(start[np.newaxis]):
        return motions[0]
    for motion in motions:
        (first,) = motion.model_copy(update={"points": 1}).draw_poses(robot)
        if clearances.is_clear(straight_line(start, first)):
            return motion
    return motions[0]


def limit_to_motors(robot: RobotDescription) -> tuple[RobotDescription, tuple[str, ...]]:
    """Return the robot with limits that its motors can keep, and notes on the changes.

    A torque limit is raised if gravity needs more than `GRAVITY_SHARE` of it. A speed limit is
    lowered if the joint could cross its range in less than `LEAST_CROSSING_S`. If the validation
    motion needs more torque than available, all speed limits are multiplied by a factor, and the
    acceleration limits by its square: the path stays the same, and the torques of inertia fall with
    the square of the factor.

    Raises:
        ConfigError: The robot has no `cad`, or its bodies leave no space for the validation motion.
    """
    load = Workload.of(robot)
    notes: list[str] = []
    joints = []
    for joint, gravity in zip(robot.joints, load.gravity_nm.tolist(), strict=True):
        least = gravity / GRAVITY_SHARE
        if joint.limits.torque < least:
            raised = _round_up(least)
            notes.append(
                f"joint {joint.name!r}: gravity needs up to {gravity:.3g} {joint.torque_unit}, so"
                f" limits.torque {joint.limits.torque:g} leaves too little for motion: {raised:g}"
                f" {joint.torque_unit} is used; correct it, or reduce the range"
            )
            joint = _with_limits(joint, torque=raised)
        fastest = (joint.limits.position_max - joint.limits.position_min) / LEAST_CROSSING_S
        if joint.limits.velocity > fastest:
            notes.append(
                f"joint {joint.name!r}: with limits.velocity {joint.limits.velocity:g} it crosses"
                f" its range in less than {LEAST_CROSSING_S:g} s, before a fault would stop it:"
                f" {fastest:.3g} is used"
            )
            joint = _with_limits(joint, velocity=float(f"{fastest:.3g}"))
        joints.append(joint)
    robot = robot.model_copy(update={"joints": tuple(joints)})
    room = _torque_reserve(robot, load)
    tightest = int(np.argmin(room))
    if room[tightest] >= 1.0:
        return robot, tuple(notes)
    speed = float(np.floor(100.0 * np.sqrt(room[tightest])) / 100.0)
    joint = joints[tightest]
    notes.append(
        f"all speeds are multiplied by {speed:g} and accelerations by its square: the torque"
        f" limit of joint {joint.name!r}, {joint.limits.torque:g} {joint.torque_unit}, is too"
        " low for a faster validation motion"
    )
    return slow_down(robot, speed), tuple(notes)


def slow_down(robot: RobotDescription, speed: float) -> RobotDescription:
    """Return the robot with speeds multiplied by a factor and accelerations by its square."""
    joints = tuple(
        _with_limits(
            joint,
            velocity=joint.limits.velocity * speed,
            acceleration=joint.limits.acceleration * speed**2,
        )
        for joint in robot.joints
    )
    return robot.model_copy(update={"joints": joints})


def _torque_reserve(robot: RobotDescription, load: Workload) -> FloatArray:
    """Return the factor by which each joint's torque in the validation motion could grow, (n,)."""
    model, values = _link_model(robot)
    motion = validation_motion(robot).plan(robot, SAMPLE_S)
    q, v, a = motion.position, motion.velocity, motion.acceleration
    rest = np.zeros_like(q)
    gravity = torque(model, q, rest, rest, values)
    of_motors = a if model.coupling is None else model.coupling.to_motors(a)
    moving = torque(model, q, v, a, values) - gravity + load.rotors(robot) * of_motors
    left = TORQUE_SHARE * _torque_limits(robot) - np.sign(moving) * gravity
    return np.asarray((left / np.maximum(np.abs(moving), 1e-12)).min(axis=0))


def _link_model(robot: RobotDescription) -> tuple[RobotModel, FloatArray]:
    model = RobotModel.from_description(robot, rotors=False, friction=False, spring=False)
    return model, cad_parameters(model, robot)[0]


def _torque_limits(robot: RobotDescription) -> FloatArray:
    return np.array([joint.limits.torque for joint in robot.joints])


def _with_limits(joint: Joint, **values: float) -> Joint:
    rounded = {name: float(f"{value:.6g}") for name, value in values.items()}
    return joint.model_copy(update={"limits": joint.limits.model_copy(update=rounded)})


def _round_up(value: float) -> float:
    """Return the value rounded up to two digits."""
    step = 10.0 ** (np.floor(np.log10(value)) - 1.0)
    return float(f"{np.ceil(value / step) * step:.2g}")
