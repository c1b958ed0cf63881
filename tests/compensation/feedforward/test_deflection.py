"""Gear deflection that motor encoders do not measure: the estimate is compared with the truth of a
simulated arm.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.motion.kinds.circle import CircleMotion
from acquisition.motion.samples import Phase
from acquisition.recording.recording import Recording
from compensation.feedforward.deflection import deflection, transmitted_torques
from config.arrays import FloatArray
from config.errors import ConfigError, DataQualityError
from config.load import load_cell, load_robot, read_named
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain, forward, jacobian
from mock_hw.plant.plant import Plant
from tests.builders.known_model import known_estimate
from tests.builders.raised_codes import raises_code

STIFFNESS = (5e4, 6e4, 2e4)
CYCLE_S = 0.008
CELL = load_cell("ir361")
POSITION_GAIN = 10.0


def robot_with(*stiffness: float | None) -> RobotDescription:
    joints = tuple(
        joint.model_copy(update={"stiffness_nm_rad": each})
        for joint, each in zip(CELL.robot.joints, stiffness, strict=True)
    )
    return CELL.robot.model_copy(update={"joints": joints})


def elastic_arm() -> Plant:
    assert CELL.plant is not None
    unmodelled = CELL.plant.unmodelled
    assert unmodelled is not None
    axes = tuple(
        axis.model_copy(update={"joint_stiffness_nm_rad": k, "joint_damping_nm_s": 100.0})
        for axis, k in zip(unmodelled.axes, STIFFNESS, strict=True)
    )
    changed = unmodelled.model_copy(update={"axes": axes})
    return Plant(CELL.robot, CELL.plant.model_copy(update={"unmodelled": changed}))


def driven_circle(plant: Plant) -> tuple[Recording, FloatArray]:
    """Drive a circle; return the recording (motor side) and the true joint positions (rad)."""
    circle = CircleMotion(
        kind="circle",
        robot="ir361",
        centre_m=(0.575, -0.078, -1.724),
        radius_m=0.2,
        speed_m_s=0.6,
        near=(0.1, -0.1, 0.4),
        periods=1,
    )
    planned = circle.plan(CELL.robot, CYCLE_S).whole()
    ratios = [joint.gear_ratio for joint in CELL.robot.joints]
    per_count = 2.0 * math.pi / (16384 * np.array(ratios))
    motors, torques, joints = [], [], []
    on, off = [True] * 3, [False] * 3
    start = plant.position
    for _ in range(150):  # move slowly to the start of the motion
        command = 4.0 * (planned.position[0] - plant.position_counts() * per_count)
        plant.advance(0.02, command, command, on, off)
    assert np.abs(plant.position_counts() * per_count - planned.position[0]).max() < 0.01, start
    for q, v in zip(planned.position, planned.velocity, strict=True):
        at = plant.position_counts() * per_count
        motors.append(at)
        torques.append(plant.measured_torque())
        joints.append(plant.position)
        command = v + POSITION_GAIN * (q - at)
        plant.advance(CYCLE_S, command, command, on, off)
    count = len(planned.position)
    recording = Recording(
        joint_names=CELL.robot.joint_names,
        time_s=CYCLE_S * np.arange(count, dtype=np.float64),
        position=np.array(motors),
        torque_nm=np.array(torques),
        valid=np.ones(count, dtype=np.bool_),
        phase=planned.phase,
        sample_index=np.arange(count),
        source="import",
    )
    return recording, np.array(joints)


def test_the_estimate_has_the_size_of_the_true_deflection() -> None:
    recording, joints = driven_circle(elastic_arm())
    chain = Chain.from_description(CELL.robot)
    main = recording.phase == Phase.MAIN
    motors, torques = recording.position[main], recording.torque_nm[main]
    true = np.linalg.norm(forward(chain, joints[main]) - forward(chain, motors), axis=1)
    true_rms = float(np.sqrt(np.mean(true**2)))
    assert 1e-3 < true_rms < 3e-3  # the encoders do not measure this error
    robot = robot_with(*STIFFNESS)
    found = deflection(robot, motors, torques)
    assert found is not None
    assert true_rms < found.rms_m < 1.3 * true_rms  # friction and rotors increase the estimate
    assert true.max() < found.max_m < 1.4 * true.max()


def test_a_model_gives_the_torques_through_the_gears() -> None:
    """Axis 3 has a parameter for its rotor.

    The rotors of axes 1 and 2 are part of the link inertias.
    """
    recording, joints = driven_circle(elastic_arm())
    main = recording.phase == Phase.MAIN
    true = (recording.position - joints)[main]
    robot = robot_with(*STIFFNESS)
    _, *bending = transmitted_torques(known_estimate(CELL, {}), robot, recording)
    found = deflection(robot, *bending)
    assert found is not None
    assert len(found.joint) == pytest.approx(np.count_nonzero(main), abs=2)
    assert found.joint[:, 1:].mean(axis=0) == pytest.approx(true[:, 1:].mean(axis=0), rel=0.01)
    assert found.joint[:, 2].std() == pytest.approx(true[:, 2].std(), rel=0.05)
    measured = recording.torque_nm[main] / STIFFNESS
    assert measured[:, 2].std() > 10.0 * true[:, 2].std()  # mainly friction


def test_a_recording_that_is_too_short_for_torques_by_a_model_is_refused() -> None:
    recording, _ = driven_circle(elastic_arm())
    phase = np.full(len(recording.phase), Phase.APPROACH, dtype=np.uint8)
    phase[:10] = Phase.MAIN
    with raises_code(DataQualityError, "RID-RECORDING-SHORT"):
        transmitted_torques(known_estimate(CELL, {}), CELL.robot, replace(recording, phase=phase))


POSE = np.array([[0.2, -0.3, 0.5], [0.1, 0.4, 0.9]])
TORQUE = np.array([[10.0, 200.0, -60.0], [-5.0, 150.0, 20.0]])


def test_only_gears_with_known_stiffness_are_included() -> None:
    found = deflection(robot_with(None, 6e4, None), POSE, TORQUE)
    assert found is not None
    assert found.known.tolist() == [False, True, False]
    assert found.joint[:, [0, 2]].tolist() == [[0.0, 0.0], [0.0, 0.0]]
    assert found.joint[:, 1] == pytest.approx(TORQUE[:, 1] / 6e4)
    slopes = jacobian(Chain.from_description(CELL.robot), POSE)[:, :3, 1]
    moved = np.linalg.norm(slopes, axis=1) * np.abs(TORQUE[:, 1]) / 6e4
    assert found.distance_m == pytest.approx(moved, rel=0.01)


def test_without_any_stiffness_there_is_no_estimate() -> None:
    assert deflection(CELL.robot, POSE, TORQUE) is None


def test_a_gear_of_a_coupled_wrist_deflects_every_joint_that_its_motor_moves() -> None:
    coupling = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.5, 1.0))
    robot = robot_with(None, 6e4, None).model_copy(update={"coupling": coupling})
    found = deflection(robot, POSE, TORQUE)
    assert found is not None
    bent = TORQUE[:, 1] / 6e4
    assert found.joint == pytest.approx(np.stack([0.0 * bent, bent, 0.5 * bent], axis=1))


@pytest.mark.parametrize("wrong", ["0.0", "-50000.0", "5.0"])
def test_an_implausible_stiffness_is_refused(tmp_path: Path, wrong: str) -> None:
    text = read_named("ir361", "robots", None)[0].decode()
    file = tmp_path / "robot.yaml"
    file.write_text(text.replace("gear_ratio: 121.0", f"stiffness_nm_rad: {wrong}"))
    with raises_code(ConfigError, "RID-FILE-VALUE", "stiffness_nm_rad"):
        load_robot(str(file))
