"""Servo loops on one axis about the vertical, compared with a linear system of known matrices."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.robot import Joint, JointLimits, RobotDescription
from config.simulation.plant import (
    LinkInertia,
    PlantConfig,
    SimulatedAxis,
    UnmodelledAxis,
    UnmodelledEffects,
)
from mock_hw.plant.plant import Plant
from mock_hw.plant.servo_loops import solve_with_friction, spring_torque

INERTIA = 5.0
GAIN = 300.0
INTEGRAL_TIME = 0.1
BANDWIDTH = 2 * math.pi * 300.0
ON, OFF = [True], [False]
CYCLE = 0.008


def one_axis(
    *,
    coulomb: float = 0.0,
    viscous: float = 0.0,
    rotor: float = 0.0,
    unmodelled: UnmodelledAxis | None = None,
) -> Plant:
    limits = JointLimits(
        position_min=-9.0, position_max=9.0, velocity=9.0, acceleration=99.0, torque=999.0
    )
    robot = RobotDescription(
        name="turntable",
        kinematics=Kinematics(convention="modified_dh", rows=(KinematicRow(),)),
        joints=(Joint(name="axis1", limits=limits, gear_ratio=100.0, armature=rotor > 0.0),),
    )
    axis = SimulatedAxis(
        rotor_inertia_kg_m2=rotor,
        coulomb_nm=coulomb,
        viscous_nm_s=viscous,
        velocity_gain_nm_s=GAIN,
        velocity_integral_time_s=INTEGRAL_TIME,
        rated_motor_torque_nm=0.5,
        peak_motor_torque_nm=1.5,
        encoder_increments_per_motor_rev=10_000,
        brake_torque_nm=500.0,
    )
    link = LinkInertia(
        mass_kg=1.0, centre_m=(0.0, 0.0, 0.0), inertia_kg_m2=(1.0, 1.0, INERTIA, 0.0, 0.0, 0.0)
    )
    extra = UnmodelledEffects(axes=(unmodelled,)) if unmodelled else None
    return Plant(
        robot, PlantConfig(name="turntable", links=(link,), axes=(axis,), unmodelled=extra)
    )


@pytest.mark.parametrize("viscous", [0.0, 40.0])
def test_a_velocity_step_response_agrees_with_linear_theory(viscous: float) -> None:
    plant = one_axis(viscous=viscous)
    # The states are velocity, integral of the velocity error, torque, and the constant command.
    system = np.array(
        [
            [-viscous / INERTIA, 0.0, 1.0 / INERTIA, 0.0],
            [-1.0, 0.0, 0.0, 1.0],
            [-BANDWIDTH * GAIN, BANDWIDTH * GAIN / INTEGRAL_TIME, -BANDWIDTH, BANDWIDTH * GAIN],
            [0.0, 0.0, 0.0, 0.0],
        ]
    )
    step = 0.2
    state = np.array([0.0, 0.0, 0.0, step])
    peak = 0.0
    for _ in range(50):
        plant.advance(CYCLE, [step], [step], ON, OFF)
        state = expm(system * CYCLE) @ state
        assert plant.velocity[0] == pytest.approx(state[0], abs=2e-5 * step)
        assert plant.torque[0] == pytest.approx(state[2], abs=2e-4 * GAIN * step)
        peak = max(peak, plant.velocity[0])
    assert 1.0 < peak / step < 1.3
    assert plant.velocity[0] == pytest.approx(step, rel=0.02)


def test_a_constant_load_leaves_no_velocity_error() -> None:
    plant = one_axis(coulomb=20.0, viscous=15.0)
    for _ in range(250):
        plant.advance(CYCLE, [0.5], [0.5], ON, OFF)
    assert plant.velocity[0] == pytest.approx(0.5, rel=1e-6)
    assert plant.torque[0] == pytest.approx(20.0 + 15.0 * 0.5, rel=1e-6)


def test_the_torque_is_limited_without_integrator_windup() -> None:
    plant = one_axis()
    fastest, velocities = 0.0, []
    for cycle in range(300):
        command = 3.0 if cycle < 30 else 0.0
        plant.advance(CYCLE, [command], [command], ON, OFF, torque_limit=[40.0])
        fastest = max(fastest, abs(plant.torque[0]))
        velocities.append(plant.velocity[0])
    assert fastest <= 40.0 + 1e-9
    assert velocities[29] == pytest.approx(30 * CYCLE * 40.0 / INERTIA, rel=0.02)
    # At the torque limit the axis brakes as fast as it accelerated, and hardly overshoots.
    assert min(velocities) > -0.1 * max(velocities)
    assert abs(velocities[-1]) < 1e-3


def test_the_motor_is_limited_to_its_peak_torque() -> None:
    plant = one_axis()
    plant.advance(0.1, [9.0], [9.0], ON, OFF, torque_limit=[1e6])
    assert plant.torque[0] == pytest.approx(1.5 * 100.0, rel=1e-6)


def test_friction_holds_an_axis_exactly_up_to_its_size() -> None:
    plant = one_axis(coulomb=20.0)
    for _ in range(100):  # at first the velocity command causes at most 0.05 * 300 = 15 Nm
        plant.advance(0.0005, [0.05], [0.05], ON, OFF)
        if plant.torque[0] < 20.0:
            assert plant.velocity[0] == 0.0
            assert plant.position[0] == 0.0
    assert plant.velocity[0] > 0.0


def test_coulomb_friction_stops_a_coasting_axis_after_the_expected_distance() -> None:
    plant = one_axis(coulomb=20.0)
    for _ in range(250):
        plant.advance(CYCLE, [1.0], [1.0], ON, OFF)
    before = plant.position[0]
    plant.advance(0.1, [0.0], [0.0], OFF, OFF)
    travelled = plant.position[0]
    for _ in range(40):
        plant.advance(CYCLE, [0.0], [0.0], OFF, OFF)
    assert plant.velocity[0] == 0.0
    # The distance is ½ J v² / f_C; the decaying motor torque (20 Nm, 300 Hz) counts as more v.
    decay = 20.0 / BANDWIDTH / INERTIA
    assert plant.position[0] - before == pytest.approx(
        0.5 * INERTIA * (1.0 + decay) ** 2 / 20.0, rel=2e-4
    )
    assert travelled < plant.position[0]
    rest = plant.position[0]
    plant.advance(10.0, [0.0], [0.0], OFF, OFF)
    assert plant.position[0] == rest


def test_a_brake_stops_a_moving_axis_and_holds_against_the_motor() -> None:
    plant = one_axis()
    for _ in range(100):
        plant.advance(CYCLE, [1.0], [1.0], ON, OFF)
    plant.advance(1.05 * INERTIA * 1.0 / 500.0, [0.0], [0.0], OFF, ON)
    assert plant.velocity[0] == 0.0
    rest = plant.position[0]
    plant.advance(0.5, [1.0], [1.0], ON, ON)
    assert plant.torque[0] == pytest.approx(150.0, rel=1e-6)
    assert plant.position[0] == rest


def test_a_velocity_command_is_a_ramp_within_a_call() -> None:
    whole, parts = one_axis(viscous=10.0), one_axis(viscous=10.0)
    for cycle in range(100):
        start, end = 0.01 * cycle, 0.01 * (cycle + 1)
        whole.advance(CYCLE, [start], [end], ON, OFF)
        for part in range(8):
            between = [start + 0.01 * (part + x) / 8 for x in (0, 1)]
            parts.advance(CYCLE / 8, [between[0]], [between[1]], ON, OFF)
    np.testing.assert_allclose(whole.position, parts.position, rtol=1e-9)
    np.testing.assert_allclose(whole.torque, parts.torque, rtol=1e-6)


def test_unmodelled_friction_increases_the_torque_of_slow_motion() -> None:
    plant = one_axis(
        coulomb=10.0, unmodelled=UnmodelledAxis(stribeck_nm=8.0, stribeck_velocity_rad_s=0.05)
    )
    torques = {}
    for speed in (0.02, 1.0):
        for _ in range(400):
            plant.advance(CYCLE, [speed], [speed], ON, OFF)
        torques[speed] = plant.torque[0]
    assert torques[0.02] == pytest.approx(10.0 + 8.0 * math.exp(-0.02 / 0.05), rel=1e-3)
    assert torques[1.0] == pytest.approx(10.0, rel=1e-3)


def test_friction_falls_as_the_axis_warms_up() -> None:
    plant = one_axis(coulomb=10.0, unmodelled=UnmodelledAxis(friction_drift_per_s=-0.01))
    torques = []
    for _ in range(2):
        for _ in range(1250):
            plant.advance(CYCLE, [0.1], [0.1], ON, OFF)
        torques.append(plant.torque[0])
    assert torques == pytest.approx([9.0, 8.0], rel=1e-2)


def test_load_friction_cogging_and_tachometer_error_appear_in_the_torque() -> None:
    quiet = one_axis(coulomb=10.0)
    rough = one_axis(
        coulomb=10.0,
        unmodelled=UnmodelledAxis(load_friction=0.1, cogging_nm=1.0, tachometer_ripple=0.01),
    )
    spread = {}
    for plant in (quiet, rough):
        for _ in range(200):
            plant.advance(CYCLE, [0.1], [0.1], ON, OFF)
        torques = []
        for _ in range(400):
            plant.advance(0.0011, [0.1], [0.1], ON, OFF)
            torques.append(plant.torque[0])
        spread[plant] = (np.mean(torques), np.std(torques))
    assert spread[quiet] == pytest.approx((10.0, 0.0), abs=1e-3)
    assert spread[rough][0] == pytest.approx(10.0 / 0.9, rel=0.02)
    assert spread[rough][1] > 0.1


def test_the_spring_torque_is_the_derivative_of_its_energy() -> None:
    spring = np.array([0.0, 7500.0, 0.25, 0.488, 0.1])

    def energy(angle: float) -> float:
        length = math.sqrt(0.488**2 + 0.1**2 - 2 * 0.488 * 0.1 * math.cos(angle))
        return 0.5 * 7500.0 * (length - 0.25) ** 2

    for angle in (-1.2, -0.3, 0.0, 0.8):
        slope = (energy(angle + 1e-5) - energy(angle - 1e-5)) / 2e-5
        assert spring_torque(spring, angle) == pytest.approx(slope, abs=1e-5)


@settings(max_examples=50)
@given(seed=st.integers(0, 10_000), count=st.integers(1, 7))
def test_friction_is_the_holding_force_or_its_full_size_against_the_motion(
    seed: int, count: int
) -> None:
    random = np.random.default_rng(seed)
    root = random.normal(size=(count, count))
    mass = root @ root.T / count + np.eye(count)
    momentum = random.normal(size=count)
    limit = random.uniform(0.0, 1.0, size=count)
    velocity = random.normal(size=count)
    solve_with_friction(mass, momentum, limit, velocity)
    friction = momentum - mass @ velocity
    moving = velocity != 0.0
    np.testing.assert_allclose(friction[moving], (limit * np.sign(velocity))[moving], atol=1e-9)
    assert (abs(friction[~moving]) <= limit[~moving] + 1e-9).all()
