"""A simulated plant for a robot whose links are known: motors and loops are invented."""

from __future__ import annotations

from typing import Final

import numpy as np

from config.robot.robot import Joint, RobotDescription
from config.simulation.plant import LinkInertia, PlantConfig, SimulatedAxis
from rid_daq.jobs.starter.workload import Workload

SOFTEST_LOOP_RAD_S: Final = 60.0
FASTEST_LOOP_RAD_S: Final = 400.0
INTEGRAL_TIME_S: Final = 0.04
ERROR_AT_LIMIT_RAD: Final = 0.02
ERROR_AT_LIMIT_M: Final = 0.005
"""How far the torque limit pushes a joint off its set-point: what the velocity loop integrates."""
FRICTION_SHARE: Final = 0.04
TORQUE_NOISE_SHARE: Final = 0.003
INCREMENTS_PER_TURN: Final = 2_000_000


def simulated_plant(robot: RobotDescription) -> PlantConfig:
    """Return the robot's links with motors and velocity loops that can move them in every pose.

    A loop is as stiff as the torque limit asks, and fast enough for the largest inertia about the
    joint. Its rotor is heavy enough that it is not too fast where the other joints give way: with
    gains K and rotors K / `FASTEST_LOOP_RAD_S` no eigenvalue of (M + I)⁻¹ K is above that, whatever
    the links' M, and so nothing has to be known of the coupling between the joints. Rotors are
    plain armatures.

    Raises
    ------
    ConfigError
        The robot has no `cad`.
    """
    load = Workload.of(robot)
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
            _axis(joint, inertia)
            for joint, inertia in zip(robot.joints, load.inertia.tolist(), strict=True)
        ),
    )


def _axis(joint: Joint, inertia: float) -> SimulatedAxis:
    torque, ratio = joint.limits.torque, abs(joint.gear_ratio)
    error = ERROR_AT_LIMIT_M if joint.type == "prismatic" else ERROR_AT_LIMIT_RAD
    # Of the links and of the rotor, which is gain / FASTEST_LOOP_RAD_S.
    fast_enough = inertia / (1.0 / SOFTEST_LOOP_RAD_S - 1.0 / FASTEST_LOOP_RAD_S)
    gain = max(torque * INTEGRAL_TIME_S / error, fast_enough)
    friction = FRICTION_SHARE * torque
    return SimulatedAxis(
        rotor_inertia_kg_m2=gain / FASTEST_LOOP_RAD_S / ratio**2,
        coulomb_nm=friction,
        viscous_nm_s=friction / joint.limits.velocity,
        velocity_gain_nm_s=gain,
        velocity_integral_time_s=INTEGRAL_TIME_S,
        rated_motor_torque_nm=torque / (3.0 * ratio),
        peak_motor_torque_nm=torque / ratio,
        encoder_increments_per_motor_rev=int(np.clip(INCREMENTS_PER_TURN / ratio, 16, 2**24)),
        torque_noise_nm=TORQUE_NOISE_SHARE * torque,
        brake_torque_nm=torque,
        initial_position=_start(joint),
    )


def _start(joint: Joint) -> float:
    """Return where a joint stands at first: at zero, or in the middle where zero is outside."""
    low, high = joint.limits.position_min, joint.limits.position_max
    return 0.0 if low < 0.0 < high else 0.5 * (low + high)
