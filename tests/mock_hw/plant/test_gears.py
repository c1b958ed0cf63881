"""Elastic gears with spring, damper and play, between a motor and a load about the vertical."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.simulation.plant import UnmodelledAxis
from mock_hw.plant.plant import Plant
from tests.builders.raised_codes import raises_invalid
from tests.mock_hw.plant.test_servo_loops import INERTIA, OFF, ON, one_axis

STIFFNESS = 2e4
STEP = 0.0005


def plant_with_gear(damping: float = 0.0, play: float = 0.0) -> Plant:
    gear = UnmodelledAxis(
        joint_stiffness_nm_rad=STIFFNESS, joint_damping_nm_s=damping, play_rad=play
    )
    return one_axis(unmodelled=gear, rotor=0.0004)


def motor_angle(plant: Plant) -> float:
    """Return the motor's angle on the link side [rad], by its encoder."""
    return float(plant.position_counts()[0]) * 2.0 * math.pi / (10_000 * 100.0)


def load_after_braking(plant: Plant, seconds: float = 1.0) -> list[float]:
    """Move, close the motor's brake, and return the load's deflection [rad] in each later step."""
    for _ in range(200):
        plant.advance(0.005, [0.5], [0.5], ON, OFF)
    places = []
    for _ in range(round(seconds / STEP)):
        plant.advance(STEP, [0.0], [0.0], OFF, ON)
        places.append(plant.position[0] - motor_angle(plant))
    return places


def test_a_load_oscillates_with_the_frequency_and_damping_of_its_gear() -> None:
    damping = 12.0
    places = np.array(load_after_braking(plant_with_gear(damping)))[100:]
    rate = math.sqrt(STIFFNESS / INERTIA)
    damping_ratio = damping / (2.0 * math.sqrt(STIFFNESS * INERTIA))
    tops = np.flatnonzero((places[1:-1] > places[:-2]) & (places[1:-1] >= places[2:])) + 1
    period = np.diff(tops).mean() * STEP
    assert period == pytest.approx(2 * math.pi / (rate * math.sqrt(1 - damping_ratio**2)), rel=0.01)
    falling = np.log(places[tops[:-1]] / places[tops[1:]]).mean()
    assert falling == pytest.approx(
        2 * math.pi * damping_ratio / math.sqrt(1 - damping_ratio**2), rel=0.05
    )


def test_without_damping_the_load_keeps_its_energy() -> None:
    places = np.array(load_after_braking(plant_with_gear(), 4.0))
    early, late = abs(places[200:1200]).max(), abs(places[-1000:]).max()
    assert late == pytest.approx(early, rel=0.01)


def test_the_load_lags_its_motor_by_torque_over_stiffness_and_half_the_play() -> None:
    for play in (0.0, 0.003):
        plant = plant_with_gear(damping=100.0, play=play)
        for k in range(400):
            plant.advance(0.005, [0.01 * k], [0.01 * (k + 1)], ON, OFF)
        lag = motor_angle(plant) - plant.position[0]
        assert lag == pytest.approx(INERTIA * 2.0 / STIFFNESS + 0.5 * play, rel=0.02)


def test_within_its_play_a_load_moves_freely() -> None:
    plant = plant_with_gear(damping=50.0, play=0.05)
    for k in range(200):  # the accelerating motor pushes the load to one end of the play
        plant.advance(0.005, [0.0025 * k], [0.0025 * (k + 1)], ON, OFF)
    speeds = []
    for _ in range(60):
        plant.advance(0.001, [0.0], [0.0], OFF, ON)
        speeds.append(plant.velocity[0])
    assert max(speeds[10:]) - min(speeds[10:]) < 1e-9


def test_an_elastic_gear_needs_a_stiffness() -> None:
    with raises_invalid("", "play_rad", "joint_stiffness_nm_rad"):
        UnmodelledAxis(play_rad=0.001)
