"""A simulated plant for a robot whose links are known: motors and loops are invented."""

from __future__ import annotations

from typing import Final

import numpy as np

from config.robot.robot import Joint, RobotDescription
from config.simulation.plant import LinkInertia, PlantConfig, SimulatedAxis
from dynamics.model.cad import cad_parameters
from dynamics.model.inverse_dynamics import mass_matrix
from dynamics.model.robot_model import RobotModel

BANDWIDTH_RAD_S: Final = (60.0, 500.0)
FRICTION_SHARE: Final = 0.04
BREAKAWAY_SPEED_RAD_S: Final = 0.05
TORQUE_NOISE_SHARE: Final = 0.003
INCREMENTS_PER_TURN: Final = 2_000_000


def simulated_plant(robot: RobotDescription) -> PlantConfig:
    """Return the URDF's links with motors that can move them."""
    model = RobotModel.from_description(robot, rotors=False, friction=False, spring=False)
    values, _ = cad_parameters(model, robot)
    rest = np.array([[_start(joint) for joint in robot.joints]])
    inertias = np.diagonal(mass_matrix(model, rest, values)[0])
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
            _axis(joint, float(inertia))
            for joint, inertia in zip(robot.joints, inertias, strict=True)
        ),
    )


def _axis(joint: Joint, inertia: float) -> SimulatedAxis:
    torque, ratio = joint.limits.torque, abs(joint.gear_ratio)
    inertia = max(inertia, 1e-3 * torque / joint.limits.acceleration)
    slowest, fastest = BANDWIDTH_RAD_S
    gain = min(max(torque / joint.limits.velocity, slowest * inertia), fastest * inertia)
    # Not more friction than the loop overcomes at once: without rotors wrists are light.
    friction = min(FRICTION_SHARE * torque, BREAKAWAY_SPEED_RAD_S * gain)
    return SimulatedAxis(
        rotor_inertia_kg_m2=0.0,
        coulomb_nm=friction,
        viscous_nm_s=friction / joint.limits.velocity,
        velocity_gain_nm_s=gain,
        velocity_integral_time_s=0.1,
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
