from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from config.cell.torque_filter import ButterworthFilter
from config.load import load_cell
from config.robot.robot import RobotDescription
from config.simulation.plant import PlantConfig
from mock_hw.plant.plant import Plant
from mock_hw.plant.rigid_bodies import build_rigid_bodies

Array = np.ndarray[Any, np.dtype[Any]]
CYCLE = 0.008
ON, OFF, STILL = [True] * 3, [False] * 3, [0.0] * 3
FILTER = ButterworthFilter(order=8, cutoff_hz=40.0)
POINT_SPEED, RADIUS = 0.6, 0.2


@pytest.fixture(scope="module")
def robot() -> RobotDescription:
    return load_cell("ir361").robot


@pytest.fixture(scope="module")
def truth() -> PlantConfig:
    plant = load_cell("ir361").plant
    assert plant is not None
    return plant


def change_plant(plant: PlantConfig, **axis: float) -> PlantConfig:
    axes = tuple(one.model_copy(update=axis) for one in plant.axes)
    return plant.model_copy(update={"axes": axes})


def required_torque(
    robot: RobotDescription, plant: PlantConfig, q: Array, v: Array, a: Array
) -> Array:
    """Return the motor torques (samples, n): Pinocchio's inverse dynamics, spring and friction."""
    bodies = build_rigid_bodies(robot, plant)
    data, coupling = bodies.model.createData(), bodies.gearing
    torque = np.array(
        [
            coupling.T @ pin.rnea(bodies.model, data, *(coupling @ x for x in sample))
            for sample in zip(q, v, a, strict=True)
        ]
    )
    spring = robot.spring
    assert spring is not None
    assert spring.l_m is not None
    assert spring.r_m is not None
    assert plant.spring is not None
    lever = spring.l_m * spring.r_m
    length = np.sqrt(spring.l_m**2 + spring.r_m**2 - 2 * lever * np.cos(q[:, 1]))
    stretch = length - plant.spring.free_length_m
    torque[:, 1] += plant.spring.stiffness_n_per_m * stretch * lever * np.sin(q[:, 1]) / length
    torque += v * [axis.viscous_nm_s for axis in plant.axes]
    return torque + np.sign(v) * [axis.coulomb_nm for axis in plant.axes]


def energy(robot: RobotDescription, plant: PlantConfig) -> Callable[[Plant], float]:
    bodies = build_rigid_bodies(robot, plant)
    data, coupling = bodies.model.createData(), bodies.gearing

    def of(simulated: Plant) -> float:
        q, v = coupling @ simulated.position, coupling @ simulated.velocity
        spring = robot.spring
        assert spring is not None
        assert spring.l_m is not None
        assert spring.r_m is not None
        assert plant.spring is not None
        lever = spring.l_m * spring.r_m
        length = math.sqrt(
            spring.l_m**2 + spring.r_m**2 - 2 * lever * math.cos(simulated.position[1])
        )
        stretch = length - plant.spring.free_length_m
        return float(
            pin.computeKineticEnergy(bodies.model, data, q, v)
            + pin.computePotentialEnergy(bodies.model, data, q)
            + 0.5 * plant.spring.stiffness_n_per_m * stretch**2
        )

    return of


def test_finely_logged_motion_satisfies_the_equations_with_friction(
    robot: RobotDescription, truth: PlantConfig
) -> None:
    plant = truth.without_unmodelled()
    simulated = Plant(robot, plant)
    step, count = 0.0005, 4000
    amplitude, rate = np.array([1.5, -0.9, 1.6]), np.array([3.0, 4.5, 6.5])

    def command(time_s: float) -> Array:
        return amplitude * np.sin(rate * time_s)

    log = []
    for k in range(count):
        simulated.advance(step, command(k * step), command((k + 1) * step), ON, OFF)
        log.append((simulated.position, simulated.velocity, simulated.torque))
    q, v, torque = (np.array(x) for x in zip(*log, strict=True))
    a = (v[2:] - v[:-2]) / (2 * step)
    q, v, torque = q[1:-1], v[1:-1], torque[1:-1]
    error = torque - required_torque(robot, plant, q, v, a)
    near_reversal = np.convolve((abs(v) < 0.02).any(axis=1), np.ones(9), "same") > 0
    assert near_reversal.mean() < 0.2
    error, torque = error[~near_reversal], torque[~near_reversal]
    assert (abs(torque).max(axis=0) > [70.0, 150.0, 70.0]).all()
    assert (np.sqrt((error**2).mean(axis=0)) < 1e-4 * np.sqrt((torque**2).mean(axis=0))).all()
    assert (abs(error).max(axis=0) < 1e-3 * abs(torque).max(axis=0)).all()


def test_sampled_motion_at_8_ms_satisfies_the_equations_on_every_bin(
    robot: RobotDescription, truth: PlantConfig
) -> None:
    """The filter is compensated, the position differentiated on the bins: no delay and no bias."""
    plant = change_plant(truth.without_unmodelled(), coulomb_nm=0.0, torque_noise_nm=0.0)
    simulated = Plant(robot, plant, FILTER)
    samples, finer = 500, 4
    base = 2 * np.pi / (samples * CYCLE)
    low, high = base * np.array([2, 3, 4]), base * np.array([5, 6, 7])
    amplitude = np.array([1.5, -0.9, 1.6])

    def reference(time_s: float) -> tuple[Array, Array]:
        position = -amplitude / low * np.cos(low * time_s) + 0.3 / high * np.sin(high * time_s)
        velocity = amplitude * np.sin(low * time_s) + 0.3 * np.cos(high * time_s)
        return position + np.array([0.0, -0.2, 0.3]), velocity

    log: list[tuple[Array, Array]] = []
    last = np.zeros(3)
    for k in range(4 * samples):
        log.append((simulated.position, simulated.measured_torque()))
        position, velocity = reference(k * CYCLE)
        command = velocity + 10.0 * (position - simulated.position)
        simulated.advance(CYCLE, last, command, ON, OFF)
        last = command
    q, torque = (np.array(x) for x in zip(*log[-samples:], strict=True))

    frequency = np.fft.rfftfreq(samples, CYCLE)[:, None]
    band = frequency < 25.0
    spectrum = np.fft.rfft(q, axis=0) * band
    derivative = 2j * np.pi * frequency

    def on_a_finer_grid(bins: Array) -> Array:
        padded = np.zeros((samples * finer // 2 + 1, 3), dtype=complex)
        padded[: len(bins)] = bins * finer
        return np.fft.irfft(padded, samples * finer, axis=0)

    motion = [on_a_finer_grid(spectrum * derivative**order) for order in range(3)]
    predicted = np.fft.rfft(required_torque(robot, plant, *motion), axis=0)[: len(spectrum)]
    poles = np.exp(1j * np.pi * (2 * np.arange(8) + 9) / 16)
    response = 1.0 / np.prod(1j * frequency / 40.0 - poles, axis=1, keepdims=True)
    measured = np.fft.rfft(torque, axis=0) / response * band
    error = np.linalg.norm(measured - predicted / finer * band, axis=0)
    assert (error < 1e-4 * np.linalg.norm(measured, axis=0)).all()


@pytest.mark.parametrize("order", range(1, 13))
def test_the_torque_filter_passes_constant_torque_unchanged(
    robot: RobotDescription, truth: PlantConfig, order: int
) -> None:
    plant = change_plant(truth.without_unmodelled(), torque_noise_nm=0.0)
    simulated = Plant(robot, plant, ButterworthFilter(order=order, cutoff_hz=40.0))
    for _ in range(125):
        simulated.advance(CYCLE, STILL, STILL, ON, OFF)
    for _ in range(125):
        simulated.advance(CYCLE, STILL, STILL, ON, ON)
    np.testing.assert_allclose(simulated.measured_torque(), simulated.torque, atol=1e-3)
    assert abs(simulated.torque[2]) > 10.0


def test_without_friction_and_drive_the_energy_is_constant(
    robot: RobotDescription, truth: PlantConfig
) -> None:
    plant = change_plant(truth.without_unmodelled(), coulomb_nm=0.0, viscous_nm_s=0.0)
    of = energy(robot, plant)
    simulated = Plant(robot, change_plant(plant, initial_position=0.5))
    start, swing = of(simulated), 0.0
    for _ in range(500):
        simulated.advance(CYCLE, STILL, STILL, OFF, OFF)
        swing = max(swing, float(abs(simulated.velocity).max()))
        assert of(simulated) == pytest.approx(start, abs=0.01)
    assert swing > 1.0


def test_with_friction_and_without_drive_the_energy_only_falls(
    robot: RobotDescription, truth: PlantConfig
) -> None:
    plant = truth.without_unmodelled()
    of = energy(robot, plant)
    simulated = Plant(robot, change_plant(plant, initial_position=0.0))
    energies = []
    for _ in range(400):
        energies.append(of(simulated))
        simulated.advance(CYCLE, STILL, STILL, OFF, OFF)
    assert (np.diff(energies) <= 1e-6).all()
    assert energies[-1] < energies[0] - 1.0
    assert (simulated.velocity == 0.0).all()


def test_closed_brakes_hold_the_arm_exactly(robot: RobotDescription, truth: PlantConfig) -> None:
    simulated = Plant(robot, truth)
    start = simulated.position
    for _ in range(200):
        simulated.advance(CYCLE, STILL, STILL, OFF, ON)
    assert (simulated.position == start).all()
    assert (simulated.torque == 0.0).all()


def test_without_power_the_forearm_sinks(robot: RobotDescription, truth: PlantConfig) -> None:
    simulated = Plant(robot, truth)
    simulated.advance(0.5, STILL, STILL, OFF, OFF)
    assert simulated.position[2] < truth.axes[2].initial_position - 0.05


def test_at_standstill_under_gravity_nothing_drifts(
    robot: RobotDescription, truth: PlantConfig
) -> None:
    simulated = Plant(robot, truth.without_unmodelled())
    for _ in range(500):
        simulated.advance(CYCLE, STILL, STILL, ON, OFF)
    rest, counts = simulated.position, simulated.position_counts()
    for _ in range(2500):
        simulated.advance(CYCLE, STILL, STILL, ON, OFF)
    np.testing.assert_allclose(simulated.position, rest, atol=1e-8)
    assert abs(simulated.position_counts() - counts).max() <= 1
    assert abs(simulated.torque[2]) > 20.0


def run(robot: RobotDescription, truth: PlantConfig, seed: int) -> bytes:
    simulated = Plant(robot, truth, FILTER, seed=seed)
    output = b""
    for k in range(200):
        velocity = np.sin(0.05 * np.array([k, k + 1]))[:, None] * [1.0, -0.5, 0.8]
        simulated.advance(CYCLE, velocity[0], velocity[1], ON, OFF)
        for numbers in (
            simulated.position,
            simulated.velocity,
            simulated.torque,
            simulated.measured_torque(),
            simulated.position_counts(),
            simulated.torque_permille(),
        ):
            output += numbers.tobytes()
    return output


def test_the_same_seed_gives_the_same_bits(robot: RobotDescription, truth: PlantConfig) -> None:
    assert run(robot, truth, seed=7) == run(robot, truth, seed=7)
    assert run(robot, truth, seed=7) != run(robot, truth, seed=8)


def test_measured_torque_has_the_plants_noise_which_depends_on_time_only(
    robot: RobotDescription, truth: PlantConfig
) -> None:
    simulated = Plant(robot, truth, FILTER, seed=3)
    samples = []
    for _ in range(2000):
        simulated.advance(0.001, STILL, STILL, OFF, ON)
        samples.append(simulated.measured_torque())
        assert (simulated.measured_torque() == samples[-1]).all()
    noise = [axis.torque_noise_nm for axis in truth.axes]
    np.testing.assert_allclose(np.std(samples, axis=0), noise, rtol=0.06)
    assert (abs(np.mean(samples, axis=0)) < 0.1 * np.array(noise)).all()


def test_drives_report_counts_and_permille_in_their_resolution(
    robot: RobotDescription, truth: PlantConfig
) -> None:
    simulated = Plant(robot, truth, FILTER, seed=3)
    for _ in range(50):
        simulated.advance(CYCLE, [0.2, -0.1, 0.3], [0.2, -0.1, 0.3], ON, OFF)
    for i, (joint, axis) in enumerate(zip(robot.joints, truth.axes, strict=True)):
        count = 2 * math.pi / (axis.encoder_increments_per_motor_rev * joint.gear_ratio)
        permille = 0.001 * axis.rated_motor_torque_nm * joint.gear_ratio
        assert 1e-6 < count < 5e-6
        assert 0.05 < permille < 0.35
        behind = simulated.position[i] - simulated.position_counts()[i] * count
        assert 0.0 <= behind < count
        rounded = simulated.measured_torque()[i] - simulated.torque_permille()[i] * permille
        assert abs(rounded) <= 0.5 * permille + 1e-12


def test_time_advances_by_the_requested_amount(robot: RobotDescription, truth: PlantConfig) -> None:
    simulated = Plant(robot, truth)
    for duration in (0.0, 0.008, 0.00037, 0.1):
        simulated.advance(duration, STILL, STILL, OFF, ON)
    assert simulated.time_s == pytest.approx(0.10837)
    for bad in (-0.001, math.nan, math.inf):
        with pytest.raises(ValueError, match="duration_s"):
            simulated.advance(bad, STILL, STILL, OFF, ON)


def circle(count: int) -> tuple[Array, Array, Callable[[Array], Array]]:
    """Return positions and velocities (count, 3) of the thesis's horizontal circle, and `tool`.

    `tool` computes the tool's positions from joint positions.
    """

    def tool(q: Array) -> Array:
        arm = q[:, 1] + np.pi / 2
        forearm = arm + q[:, 2] - np.pi / 2
        reach = 0.480 * np.cos(arm) + 0.765 * np.cos(forearm)
        height = 0.480 * np.sin(arm) + 0.765 * np.sin(forearm)
        return np.column_stack([reach * np.cos(q[:, 0]), reach * np.sin(q[:, 0]), height])

    angle = 2 * np.pi * np.arange(count) / count
    x, y, z = 0.75 + RADIUS * np.cos(angle), RADIUS * np.sin(angle), 0.28
    reach = np.hypot(x, y)
    squared = reach**2 + z**2
    elbow = np.arccos((squared - 0.480**2 - 0.765**2) / (2 * 0.480 * 0.765))
    arm = np.arctan2(z, reach) + np.arctan2(0.765 * np.sin(elbow), 0.480 + 0.765 * np.cos(elbow))
    q = np.column_stack([np.arctan2(y, x), arm - np.pi / 2, np.pi / 2 - elbow])
    np.testing.assert_allclose(tool(q), np.column_stack([x, y, np.full(count, z)]), atol=1e-12)
    bins = np.fft.rfft(q - q.mean(axis=0), axis=0)
    rates = 2j * np.pi * np.fft.rfftfreq(count, CYCLE)[:, None]
    return q, np.fft.irfft(bins * rates, count, axis=0), tool


def test_velocity_feedforward_alone_leaves_millimetres_of_path_error(
    robot: RobotDescription, truth: PlantConfig
) -> None:
    """A 40 cm circle at 0.6 m/s, with the cell's position loop and commands one cycle late."""
    count = round(2 * np.pi * RADIUS / POINT_SPEED / CYCLE)
    q, v, tool = circle(count)
    axes = tuple(
        axis.model_copy(update={"initial_position": float(start)})
        for axis, start in zip(truth.axes, q[0], strict=True)
    )
    simulated = Plant(robot, truth.model_copy(update={"axes": axes}))
    gain = load_cell("ir361").config.position_gain_per_s
    commands = [np.zeros(3), np.zeros(3)]
    actual = []
    for k in range(3 * count):
        actual.append(simulated.position)
        feedforward = v[(k + 1) % count]  # for the SYNC at which the drives apply the command
        commands.append(feedforward + gain * (q[k % count] - actual[-1]))
        simulated.advance(CYCLE, commands[-3], commands[-2], ON, OFF)
    error = np.linalg.norm(tool(q) - tool(np.array(actual[-count:])), axis=1)
    assert 1e-3 < error.mean() < 3e-3
    assert 2e-3 < error.max() < 5e-3
