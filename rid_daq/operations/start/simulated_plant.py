"""Simulated plant for a robot whose links are known; motors and velocity loops are assumed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.robot.robot import Joint, RobotDescription
from config.robot.urdf_motors import UrdfMotor
from config.simulation.plant import LinkInertia, PlantConfig, SimulatedAxis
from dynamics.geometry.clearances import Clearances
from rid_daq.operations.start.workload import (
    INTEGRAL_TIME_S,
    Workload,
    validation_motion,
    zero_pose,
)

FRICTION_SHARE: Final = 0.04
TORQUE_NOISE_SHARE: Final = 0.003
INCREMENTS_PER_TURN: Final = 2_000_000


def simulated_plant(
    robot: RobotDescription, motors: Sequence[UrdfMotor] | None = None
) -> PlantConfig:
    """Return a plant with the robot's links, and with motors and loops that suit every pose.

    Velocity gains and rotors are those of `Workload`, so that the motors can move the links in
    every pose; rotors are simple armatures. The robot starts in the pose `zero_pose`. If bodies are
    too close there, it starts in the first pose of its validation motion.

    Args:
        robot: The robot, with its `cad`.
        motors: Known friction of the motors; unknown friction is a fraction of the torque limit.

    Raises:
        ConfigError: The robot has no `cad`.
    """
    load = Workload.of(robot)
    known: Sequence[UrdfMotor | None] = motors or [None] * len(robot.joints)
    links = []
    for cad in robot.cad or ():
        xx, xy, xz, yy, yz, zz = cad.inertia_kg_m2
        links.append(
            LinkInertia(
                mass_kg=cad.mass_kg,
                centre_m=cad.centre_m,
                inertia_kg_m2=(xx, yy, zz, xy, xz, yz),
            )
        )
    return PlantConfig(
        name=robot.name,
        links=tuple(links),
        axes=tuple(
            _simulated_axis(*each)
            for each in zip(
                robot.joints,
                load.gains(robot).tolist(),
                load.rotors(robot).tolist(),
                _initial_pose(robot).tolist(),
                known,
                strict=True,
            )
        ),
    )


def _simulated_axis(
    joint: Joint, gain: float, rotor: float, position: float, motor: UrdfMotor | None
) -> SimulatedAxis:
    torque, ratio = joint.limits.torque, abs(joint.gear_ratio)
    friction = FRICTION_SHARE * torque
    coulomb, viscous = friction, friction / joint.limits.velocity
    if motor is not None and motor.coulomb is not None and motor.viscous is not None:
        coulomb, viscous = motor.coulomb, motor.viscous
    return SimulatedAxis(
        rotor_inertia_kg_m2=rotor / ratio**2,
        coulomb_nm=coulomb,
        viscous_nm_s=viscous,
        velocity_gain_nm_s=gain,
        velocity_integral_time_s=INTEGRAL_TIME_S,
        rated_motor_torque_nm=torque / (3.0 * ratio),
        peak_motor_torque_nm=torque / ratio,
        encoder_increments_per_motor_rev=int(np.clip(INCREMENTS_PER_TURN / ratio, 16, 2**24)),
        torque_noise_nm=TORQUE_NOISE_SHARE * torque,
        brake_torque_nm=torque,
        initial_position=position,
    )


def _initial_pose(robot: RobotDescription) -> FloatArray:
    """Return the initial joint positions, (n,) [rad or m]."""
    pose = zero_pose(robot)
    if Clearances.of(robot).is_clear(pose[np.newaxis]):
        return pose
    return np.asarray(validation_motion(robot).draw_poses(robot)[0])
