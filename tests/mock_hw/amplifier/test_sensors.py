"""Sensor forces, compared with Kistler's formulas sign by sign."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from config.cell.plate import AmplifierConfig, PlateConfig
from config.simulation.plant import SimulatedPlate
from mock_hw.amplifier.sensors import PlateSensors

Array = np.ndarray[Any, np.dtype[Any]]
PC_N = (-7.5,) * 4 + (-3.8,) * 4
AMPLIFIER = AmplifierConfig(
    address="/dev/null",
    baud_rate=460800,
    rate_hz=1000.0,
    low_pass_hz=100.0,
    range_n=(2500.0,) * 4 + (10000.0,) * 4,
    sensitivity_pc_n=PC_N,
)


def plate(
    position: tuple[float, float, float] = (0.0, 0.0, 0.0),
    rotation: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> PlateConfig:
    return PlateConfig(
        a_m=0.120,
        b_m=0.200,
        az0_m=-0.054,
        position_m=position,
        rotation_rad=rotation,
        amplifier=AMPLIFIER,
    )


def formulas(forces: Array) -> Array:
    """Return the wrench on the plate about the middle of its surface, by Kistler's formulas."""
    fx12, fx34, fy14, fy23, fz1, fz2, fz3, fz4 = forces
    a, b, az0 = 0.120, 0.200, -0.054
    fx, fy, fz = fx12 + fx34, fy14 + fy23, fz1 + fz2 + fz3 + fz4
    mx, my = b * (fz1 + fz2 - fz3 - fz4), a * (-fz1 + fz2 + fz3 - fz4)
    mz = b * (-fx12 + fx34) + a * (fy14 - fy23)
    return np.array([fx, fy, fz, mx + fy * az0, my - fx * az0, mz])


@given(st.integers(0, 1000))
def test_the_sensors_sum_is_opposite_to_the_wrench_of_the_base(seed: int) -> None:
    wrench = np.random.default_rng(seed).normal(size=6) * 300.0
    forces = PlateSensors(plate(), SimulatedPlate(sensitivity_pc_n=PC_N)).forces_n(wrench)
    np.testing.assert_allclose(formulas(forces), -wrench, atol=1e-9)


@given(st.integers(0, 1000))
def test_a_displaced_and_rotated_plate_measures_the_same_wrench(seed: int) -> None:
    random = np.random.default_rng(seed)
    wrench, position, angles = (
        random.normal(size=6) * 300.0,
        random.normal(size=3),
        random.normal(size=3),
    )
    sensors = PlateSensors(
        plate(tuple(position), tuple(angles)), SimulatedPlate(sensitivity_pc_n=PC_N)
    )
    felt = formulas(sensors.forces_n(wrench))
    turned = Rotation.from_euler("xyz", angles)
    force, moment = turned.apply(felt[:3]), turned.apply(felt[3:])
    moment += np.cross(position, force)
    np.testing.assert_allclose(np.concatenate([force, moment]), -wrench, atol=1e-9)


def test_the_plate_distributes_a_force_like_equal_springs() -> None:
    """Of all sensor forces with the same wrench, the simulated ones have the least energy."""
    sensors = PlateSensors(plate(), SimulatedPlate(sensitivity_pc_n=PC_N))
    wrench = np.array([100.0, -50.0, -900.0, 30.0, 20.0, 10.0])
    forces = sensors.forces_n(wrench)
    columns = np.array([formulas(unit) for unit in np.eye(8)]).T
    np.testing.assert_allclose(forces, np.linalg.pinv(columns) @ -wrench, atol=1e-9)
    # The weight is on the +y side of the middle, so sensors 1 and 2 carry more.
    weight = sensors.forces_n([0.0, 0.0, -800.0, -80.0, 0.0, 0.0])
    np.testing.assert_allclose(weight[4:], [300.0, 300.0, 100.0, 100.0])


def test_charges_include_sensor_sign_and_crosstalk() -> None:
    wrench = np.array([100.0, -50.0, -900.0, 30.0, 20.0, 10.0])
    forces = PlateSensors(plate(), SimulatedPlate(sensitivity_pc_n=PC_N)).forces_n(wrench)
    mixing = np.eye(8)
    mixing[0, 6] = 0.02
    truth = SimulatedPlate(sensitivity_pc_n=PC_N, crosstalk=tuple(map(tuple, mixing.tolist())))
    charges = PlateSensors(plate(), truth).charges_pc(np.tile(wrench, (3, 1)))
    assert charges.shape == (3, 8)
    expected = forces * PC_N
    expected[0] += -7.5 * 0.02 * forces[6]
    np.testing.assert_allclose(charges[1], expected)
    assert charges[0, 6] == pytest.approx(-3.8 * forces[6])
