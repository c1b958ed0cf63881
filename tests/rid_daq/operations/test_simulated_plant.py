"""Velocity loops and limits that `init --urdf` selects for a simulated arm."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.motion.kinds.multipoint import CLEARANCE_M, straight_line
from config.load import load_robot
from config.robot.bodies import Workspace
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.link_cad import LinkCad
from config.robot.robot import Joint, JointLimits, RobotDescription
from dynamics.geometry.clearances import Clearances
from dynamics.model.cad import cad_parameters
from dynamics.model.inverse_dynamics import mass_matrix
from dynamics.model.robot_model import RobotModel
from mock_hw.plant.plant import Plant
from rid_daq.operations.start.simulated_plant import simulated_plant
from rid_daq.operations.start.workload import (
    ERROR_AT_LIMIT_RAD,
    FASTEST_LOOP_RAD_S,
    GRAVITY_SHARE,
    INTEGRAL_TIME_S,
    Workload,
    limit_to_motors,
    validation_motion,
    zero_pose,
)

CYCLE_S = 0.008


def arm(torques: tuple[float, ...], wrist_kg: float = 0.05) -> RobotDescription:
    """Return an arm with a vertical first axis and an upper arm of 8 kg.

    It states no rotor inertias. `torques` are the torque limits of the joints [N m].
    """
    rows = (
        KinematicRow(d_m=0.3),
        KinematicRow(alpha_rad=np.pi / 2),
        KinematicRow(a_m=0.5),
    )
    cad = (
        LinkCad(mass_kg=4.0, inertia_kg_m2=(0.02, 0.0, 0.0, 0.02, 0.0, 0.02)),
        LinkCad(mass_kg=8.0, centre_m=(0.3, 0.0, 0.0), inertia_kg_m2=(0.02, 0, 0, 0.2, 0, 0.2)),
        LinkCad(
            mass_kg=wrist_kg,
            centre_m=(0.01, 0.0, 0.05),
            inertia_kg_m2=(wrist_kg * 1e-3, 0, 0, wrist_kg * 1e-3, 0, wrist_kg * 1e-3),
        ),
    )
    limits = JointLimits(
        position_min=-2.8, position_max=2.8, velocity=3.0, acceleration=15.0, torque=1.0
    )
    return RobotDescription(
        name="arm",
        kinematics=Kinematics(convention="modified_dh", rows=rows),
        joints=tuple(
            Joint(
                name=f"j{number}",
                limits=limits.model_copy(update={"torque": torque}),
                gear_ratio=50.0,
                armature=True,
            )
            for number, torque in enumerate(torques, start=1)
        ),
        cad=cad,
    )


def test_no_loop_is_too_fast_in_any_pose_with_coupled_joints() -> None:
    robot = arm((120.0, 150.0, 4.0))
    plant = simulated_plant(robot)
    model = RobotModel.from_description(robot, rotors=False, friction=False, spring=False)
    values, _ = cad_parameters(model, robot)
    poses = np.random.default_rng(5).uniform(-2.8, 2.8, (50, 3))
    rotors = [axis.rotor_inertia_kg_m2 * 50.0**2 for axis in plant.axes]
    gains = np.diag([axis.velocity_gain_nm_s for axis in plant.axes])
    for mass in mass_matrix(model, poses, values):
        fastest = np.abs(np.linalg.eigvals(np.linalg.solve(mass + np.diag(rotors), gains))).max()
        assert fastest <= FASTEST_LOOP_RAD_S * 1.001


def test_the_error_at_the_torque_limit_stays_within_its_design_value() -> None:
    robot = arm((120.0, 150.0, 4.0))
    for joint, axis in zip(robot.joints, simulated_plant(robot).axes, strict=True):
        off = joint.limits.torque * INTEGRAL_TIME_S / axis.velocity_gain_nm_s
        assert off <= ERROR_AT_LIMIT_RAD * 1.001


@pytest.mark.parametrize("wrist_kg", [0.002, 0.05, 2.0])
def test_a_light_wrist_stays_at_rest_while_a_heavy_arm_moves(wrist_kg: float) -> None:
    robot = arm((120.0, 150.0, 4.0), wrist_kg)
    robot, _ = limit_to_motors(robot)
    plant = Plant(robot, simulated_plant(robot))
    set_point = np.array(plant.position)
    command = np.zeros(3)
    off = np.zeros(3)
    top = np.array([joint.limits.velocity for joint in robot.joints])
    slope = np.array([joint.limits.acceleration for joint in robot.joints])
    for cycle in range(400):
        swing = 0.7 * np.minimum(top, slope / (2.0 * np.pi * 0.8))
        after = swing * np.sin(2.0 * np.pi * 0.8 * (cycle + 1) * CYCLE_S) * (1.0, 1.0, 0.0)
        plant.advance(CYCLE_S, command, after, [True] * 3, [False] * 3)
        set_point += 0.5 * CYCLE_S * (command + after)
        command = after
        off = np.maximum(off, np.abs(set_point - plant.position))
    assert (off < 2.0 * ERROR_AT_LIMIT_RAD).all()


def test_a_torque_limit_below_gravity_is_raised_with_a_note() -> None:
    robot = arm((120.0, 20.0, 4.0))
    fitted, notes = limit_to_motors(robot)
    load = Workload.of(robot)
    assert fitted.joints[1].limits.torque >= load.gravity_nm[1] / GRAVITY_SHARE
    assert fitted.joints[0].limits.torque == 120.0
    assert notes[0].startswith("joint 'j2': gravity needs up to 23.8 N m")
    assert "limits.torque 20 leaves too little" in notes[0]


def test_a_weak_motor_reduces_the_speed_of_all_joints_equally() -> None:
    fitted, notes = limit_to_motors(arm((6.0, 150.0, 4.0)))
    first, second = fitted.joints[0].limits, fitted.joints[1].limits
    speed_ratio = first.velocity / 3.0
    assert speed_ratio < 0.9
    assert second.velocity == pytest.approx(first.velocity)
    assert second.acceleration == pytest.approx(15.0 * speed_ratio**2)
    assert "the torque limit of joint 'j1'" in notes[-1]


def test_a_joint_that_could_cross_its_range_before_a_stop_is_slowed_down() -> None:
    robot = arm((500.0, 500.0, 40.0))
    short = robot.joints[2].limits.model_copy(
        update={"position_min": -0.2, "position_max": 0.2, "velocity": 5.0}
    )
    last = robot.joints[2].model_copy(update={"limits": short})
    robot = robot.model_copy(update={"joints": (*robot.joints[:2], last)})
    fitted, notes = limit_to_motors(robot)
    assert fitted.joints[2].limits.velocity == pytest.approx(0.8)
    assert "limits.velocity 5 it crosses its range" in notes[0]


def test_strong_motors_keep_their_limits() -> None:
    robot = arm((500.0, 500.0, 40.0))
    assert limit_to_motors(robot) == (robot, ())


def test_the_validation_motion_can_be_reached_from_the_zero_pose() -> None:
    robot = load_robot("ur10e")
    clearances = Clearances.of(robot, Workspace(clearance_m=CLEARANCE_M))
    start = zero_pose(robot)
    assert clearances.is_clear(start[np.newaxis])
    chosen = validation_motion(robot)
    ways = [
        straight_line(start, chosen.model_copy(update={"seed": seed}).draw_poses(robot)[0])
        for seed in (1, chosen.seed)
    ]
    assert [clearances.is_clear(way) for way in ways] == [False, True]
