"""Base wrench of the plant, compared with the momentum of the robot's bodies."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from config.load import load_cell
from config.robot.kinematic_table import KinematicRow
from config.robot.robot import RobotDescription
from config.simulation.plant import PlantConfig
from mock_hw.plant.plant import Plant
from mock_hw.plant.rigid_bodies import BaseWrench

Array = np.ndarray[Any, np.dtype[Any]]
Motion = Callable[[float], tuple[Array, Array, Array]]
ON, OFF, STILL = [True] * 3, [False] * 3, [0.0] * 3
EPSILON_S = 1e-4


@pytest.fixture(scope="module")
def robot() -> RobotDescription:
    return load_cell("ir361").robot


@pytest.fixture(scope="module")
def truth() -> PlantConfig:
    plant = load_cell("ir361").plant
    assert plant is not None
    return plant


def turn(axis: int, angle: float) -> Array:
    matrix = np.eye(4)
    one, two = (axis + 1) % 3, (axis + 2) % 3
    matrix[one, one] = matrix[two, two] = np.cos(angle)
    matrix[two, one], matrix[one, two] = np.sin(angle), -np.sin(angle)
    return matrix


def shift(axis: int, length: float) -> Array:
    matrix = np.eye(4)
    matrix[axis, 3] = length
    return matrix


def poses(rows: tuple[KinematicRow, ...], q: Array) -> list[Array]:
    """Return the pose of every link of a robot with revolute joints, the base first."""
    chain = [np.eye(4)]
    for row, angle in zip(rows, q, strict=True):
        step = turn(0, row.alpha_rad) @ shift(0, row.a_m) @ turn(1, row.beta_rad)
        chain.append(chain[-1] @ step @ turn(2, row.theta_rad + angle) @ shift(2, row.d_m))
    return chain


def true_rows(robot: RobotDescription, plant: PlantConfig) -> tuple[KinematicRow, ...]:
    if plant.unmodelled is not None and plant.unmodelled.kinematics is not None:
        return plant.unmodelled.kinematics.rows
    return robot.kinematics.rows


def momentum(robot: RobotDescription, plant: PlantConfig, q: Array, v: Array) -> Array:
    """Return the momentum (linear, angular) of links and rotors about the base's origin, (6,)."""
    rows = true_rows(robot, plant)
    before, now, after = (poses(rows, q + step * v) for step in (-EPSILON_S, 0.0, EPSILON_S))
    total = np.zeros(6)
    angular_velocity = [np.zeros(3)]
    for number, link in enumerate(plant.links, start=1):
        rotation = now[number][:3, :3]
        rate = (after[number] - before[number]) / (2.0 * EPSILON_S)
        spin = rate[:3, :3] @ rotation.T
        angular_velocity.append(np.array([spin[2, 1], spin[0, 2], spin[1, 0]]))
        centre = np.append(link.centre_m, 1.0)
        linear = link.mass_kg * (rate @ centre)[:3]
        xx, yy, zz, xy, xz, yz = link.inertia_kg_m2
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        total[:3] += linear
        total[3:] += np.cross((now[number] @ centre)[:3], linear)
        total[3:] += rotation @ inertia @ rotation.T @ angular_velocity[-1]
    for index, joint in enumerate(robot.joints):
        if joint.rotor is not None:
            axis = now[joint.rotor.link][:3, :3] @ np.array(joint.rotor.axis)
            speed = axis @ angular_velocity[joint.rotor.link] + joint.gear_ratio * v[index]
            total[3:] += plant.axes[index].rotor_inertia_kg_m2 * speed * axis
    return total


def weight(robot: RobotDescription, plant: PlantConfig, q: Array) -> Array:
    total = np.zeros(6)
    for pose, link in zip(poses(true_rows(robot, plant), q)[1:], plant.links, strict=True):
        force = link.mass_kg * np.array(robot.gravity_m_s2)
        total[:3] += force
        total[3:] += np.cross((pose @ np.append(link.centre_m, 1.0))[:3], force)
    return total


def swing(seed: int) -> Motion:
    random = np.random.default_rng(seed)
    offset, amplitude = random.uniform(-1.0, 1.0, (2, 3))
    rate = random.uniform(1.0, 6.0, 3)

    def at(time_s: float) -> tuple[Array, Array, Array]:
        sine, cosine = np.sin(rate * time_s), np.cos(rate * time_s)
        return (
            offset + amplitude * sine,
            amplitude * rate * cosine,
            -amplitude * rate * rate * sine,
        )

    return at


@pytest.mark.parametrize("seed", range(5))
def test_the_base_wrench_changes_the_momentum_and_carries_the_weight(
    robot: RobotDescription, truth: PlantConfig, seed: int
) -> None:
    motion = swing(seed)
    wrench = BaseWrench(robot, truth)
    for time_s in (0.0, 0.4, 1.7):
        q, v, a = motion(time_s)
        before, after = (
            momentum(robot, truth, *motion(time_s + step)[:2]) for step in (-EPSILON_S, EPSILON_S)
        )
        expected = (after - before) / (2.0 * EPSILON_S) - weight(robot, truth, q)
        np.testing.assert_allclose(
            wrench(np.array([q, v, a])), expected, atol=3e-6 * abs(expected).max()
        )


def test_a_rotor_acts_on_the_plate_with_the_gear_ratio_and_on_its_motor_with_the_square(
    robot: RobotDescription, truth: PlantConfig
) -> None:
    """Rotor 1 is on the base. Its inertia has the effect I mu on the plate, I mu^2 at its motor."""
    axes = tuple(axis.model_copy(update={"rotor_inertia_kg_m2": 0.0}) for axis in truth.axes)
    one = axes[0].model_copy(update={"rotor_inertia_kg_m2": 0.0005})
    without = BaseWrench(robot, truth.model_copy(update={"axes": axes}))
    with_rotor = BaseWrench(robot, truth.model_copy(update={"axes": (one, *axes[1:])}))
    motion = np.array([[0.3, -0.2, 0.4], STILL, [2.0, 0.0, 0.0]])
    extra = with_rotor(motion) - without(motion)
    np.testing.assert_allclose(extra, [0, 0, 0, 0, 0, -0.0005 * 121.0 * 2.0], atol=1e-10)


def with_elastic_gears(truth: PlantConfig) -> PlantConfig:
    """Return the arm with presliding in all joints; two gears have spring, damper and play."""
    assert truth.unmodelled is not None
    first, second, third = (
        extra.model_copy(update={"presliding_rad": 0.001}) for extra in truth.unmodelled.axes
    )
    gear = {"joint_stiffness_nm_rad": 4e4, "joint_damping_nm_s": 30.0, "play_rad": 0.0005}
    axes = (first, second.model_copy(update=gear), third.model_copy(update=gear))
    return truth.model_copy(
        update={"unmodelled": truth.unmodelled.model_copy(update={"axes": axes})}
    )


def check_impulse(robot: RobotDescription, plant: PlantConfig, brake_at_s: float = 9.0) -> None:
    """Run about one second in uneven steps; compare the base's impulse with the momentum gained."""
    simulated = Plant(robot, plant, seed=2)
    simulated.advance(0.1, STILL, [0.4, -0.3, 0.5], ON, OFF)
    simulated.watch_base(True)
    start_s, start = (
        simulated.time_s,
        momentum(robot, plant, simulated.position, simulated.velocity),
    )
    ends, wrenches, carried = [start_s], [], np.zeros(6)
    for number in range(500):
        before = simulated.position
        low, high = np.sin(0.02 * number), np.sin(0.02 * (number + 1))
        command = np.array([1.5, -0.9, 1.6])
        braked = simulated.time_s > brake_at_s
        step_s = (0.002, 0.0011, 0.0037)[number % 3]
        simulated.advance(
            step_s, low * command, high * command, OFF if braked else ON, ON if braked else OFF
        )
        carried += step_s * weight(robot, plant, 0.5 * (before + simulated.position))
        end_s, wrench = simulated.take_base_wrenches()
        ends += end_s.tolist()
        wrenches += list(wrench)
    assert ends[-1] == simulated.time_s
    impulse = np.diff(ends) @ np.array(wrenches)
    gained = momentum(robot, plant, simulated.position, simulated.velocity) - start
    np.testing.assert_allclose(impulse, gained - carried, atol=2e-3 * abs(impulse).max())
    np.testing.assert_allclose(impulse[[0, 1]], (gained - carried)[[0, 1]], atol=0.02)
    assert abs(gained).max() > 1.0


def test_friction_spring_and_cogging_do_not_act_on_the_plate(
    robot: RobotDescription, truth: PlantConfig
) -> None:
    check_impulse(robot, truth)


def test_presliding_and_elastic_gears_do_not_act_on_the_plate(
    robot: RobotDescription, truth: PlantConfig
) -> None:
    check_impulse(robot, with_elastic_gears(truth))


def test_closing_brakes_act_on_the_plate_with_their_full_impulse(
    robot: RobotDescription, truth: PlantConfig
) -> None:
    check_impulse(robot, truth, brake_at_s=0.6)


def test_at_rest_the_base_carries_the_weight_with_brakes_and_with_drives(
    robot: RobotDescription, truth: PlantConfig
) -> None:
    for powered, braked in ((OFF, ON), (ON, OFF)):
        simulated = Plant(robot, truth)
        simulated.advance(2.0, STILL, STILL, powered, braked)
        np.testing.assert_allclose(
            simulated.base_wrench, -weight(robot, truth, simulated.position), atol=0.01
        )
        mass = sum(link.mass_kg for link in truth.links)
        assert simulated.base_wrench[2] == pytest.approx(-9.81 * mass)


def test_base_wrenches_are_stored_only_while_watched(
    robot: RobotDescription, truth: PlantConfig
) -> None:
    simulated = Plant(robot, truth)
    simulated.advance(0.010, STILL, STILL, OFF, ON)
    assert simulated.take_base_wrenches()[1].shape == (0, 6)
    simulated.watch_base(True)
    simulated.advance(0.010, STILL, STILL, OFF, ON)
    simulated.watch_base(True)
    assert simulated.take_base_wrenches()[1].shape == (5, 6)
    assert simulated.take_base_wrenches()[1].shape == (0, 6)
    simulated.watch_base(False)
    simulated.advance(0.010, STILL, STILL, OFF, ON)
    assert simulated.take_base_wrenches()[1].shape == (0, 6)
