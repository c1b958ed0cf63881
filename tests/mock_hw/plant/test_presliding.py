"""Presliding friction of the plant (elasto-plastic bristle model) on one vertical axis."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from config.errors import ConfigError
from config.simulation.plant import UnmodelledAxis
from mock_hw.plant.plant import Plant
from tests.builders.raised_codes import raises_code
from tests.mock_hw.plant.test_servo_loops import OFF, ON, one_axis

Array = NDArray[np.float64]

COULOMB = 20.0
PRESLIDING = 0.002
STIFFNESS = COULOMB / PRESLIDING
STEP = 0.002


def plant_with_bristles(stribeck_nm: float = 0.0) -> Plant:
    extra = UnmodelledAxis(presliding_rad=PRESLIDING, stribeck_nm=stribeck_nm)
    return one_axis(coulomb=COULOMB, unmodelled=extra)


def last_period(
    plant: Plant, amplitude: float, period_s: float, periods: int
) -> tuple[Array, Array]:
    """Return position and torque in the last period of an oscillation dominated by friction."""
    rate = 2.0 * math.pi / period_s
    steps = round(period_s / STEP)
    log = []
    for k in range(periods * steps):
        start, end = (amplitude * rate * math.cos(rate * STEP * (k + at)) for at in (0, 1))
        plant.advance(STEP, [start], [end], ON, OFF)
        log.append((plant.position[0], plant.torque[0]))
    position, torque = np.array(log[-steps:]).T
    return position, torque


def test_an_oscillation_within_presliding_is_elastic_without_loss() -> None:
    position, torque = last_period(plant_with_bristles(), 0.25 * PRESLIDING, 4.0, 3)
    slope, offset = np.polyfit(position, torque, 1)
    assert slope == pytest.approx(STIFFNESS, rel=0.01)
    rest = torque - np.polyval((slope, offset), position)
    assert abs(rest).max() < 0.02 * abs(torque).max()


def test_a_wide_oscillation_has_a_loop_of_twice_the_friction() -> None:
    position, torque = last_period(plant_with_bristles(), 50.0 * PRESLIDING, 16.0, 2)
    assert torque.max() == pytest.approx(COULOMB, rel=0.02)
    assert torque.min() == pytest.approx(-COULOMB, rel=0.02)
    lost = float(np.sum(0.5 * (torque + np.roll(torque, 1)) * (position - np.roll(position, 1))))
    assert lost == pytest.approx(4.0 * COULOMB * (0.5 * np.ptp(position) - PRESLIDING), rel=0.02)


def test_after_a_reversal_friction_changes_over_a_distance_and_not_at_once() -> None:
    position, torque = last_period(plant_with_bristles(), 50.0 * PRESLIDING, 8.0, 2)
    top = int(np.argmax(position))
    back = position[top] - position[top:]
    half_way = np.interp(PRESLIDING, back[:600], torque[top : top + 600])
    whole = np.interp(2.5 * PRESLIDING, back[:600], torque[top : top + 600])
    assert half_way == pytest.approx(0.0, abs=0.1 * COULOMB)
    assert whole < -0.95 * COULOMB


def test_a_joint_springs_back_when_the_motor_releases_it() -> None:
    plant = plant_with_bristles()
    for _ in range(150):
        plant.advance(0.001, [0.002], [0.002], ON, OFF)
    pushed, torque = plant.position[0], plant.torque[0]
    assert 0.0 < torque < 0.7 * COULOMB
    for _ in range(400):
        plant.advance(0.008, [0.0], [0.0], OFF, OFF)
    assert pushed > 1e-4
    assert abs(plant.position[0]) < 0.05 * pushed


def test_a_vibrating_load_below_the_friction_does_not_drift() -> None:
    """The plant's elasto-plastic model stays elastic; the LuGre model would creep."""
    plant = plant_with_bristles(2.0)
    for _ in range(30):
        plant.advance(0.001, [0.002], [0.002], ON, OFF)
    places = []
    for k in range(4000):
        command = 0.002 * math.sin(math.pi * k / 2.0)
        plant.advance(0.001, [command], [command], ON, OFF)
        places.append(plant.position[0])
    early, late = np.mean(places[200:400]), np.mean(places[-200:])
    assert abs(late - early) < 0.1 * PRESLIDING


def test_presliding_without_friction_is_refused() -> None:
    with raises_code(ConfigError, "RID-PLANT-UNFIT", "presliding_rad"):
        one_axis(unmodelled=UnmodelledAxis(presliding_rad=PRESLIDING))
