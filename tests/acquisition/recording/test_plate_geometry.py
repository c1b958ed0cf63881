from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.recording.plate_geometry import PlateGeometry, plate_wrench_matrix
from config.cell.plate import AmplifierConfig, PlateConfig

AMPLIFIER = AmplifierConfig(
    address="nowhere",
    baud_rate=115_200,
    rate_hz=100.0,
    low_pass_hz=30.0,
    range_n=(5000.0,) * 8,
    sensitivity_pc_n=(-7.5,) * 4 + (-3.8,) * 4,
)


def plate(**changed: object) -> PlateConfig:
    plain = {
        "a_m": 0.12,
        "b_m": 0.2,
        "az0_m": -0.054,
        "position_m": (0.0, 0.0, 0.0),
        "rotation_rad": (0.0, 0.0, 0.0),
        "amplifier": AMPLIFIER,
    }
    return PlateConfig.model_validate(plain | changed)


def kistler(channels: np.ndarray, a: float, b: float, az0: float) -> list[float]:
    """Return Fx, Fy, Fz, Mx', My', Mz, computed line by line as in the data sheet."""
    fx12, fx34, fy14, fy23, fz1, fz2, fz3, fz4 = channels
    fx = fx12 + fx34
    fy = fy14 + fy23
    fz = fz1 + fz2 + fz3 + fz4
    mx = b * (fz1 + fz2 - fz3 - fz4)
    my = a * (-fz1 + fz2 + fz3 - fz4)
    mz = b * (-fx12 + fx34) + a * (fy14 - fy23)
    return [fx, fy, fz, mx + fy * az0, my - fx * az0, mz]


forces = st.lists(st.floats(-2000.0, 2000.0), min_size=8, max_size=8).map(np.array)
lengths = st.floats(0.05, 0.5)
shifts = st.tuples(*[st.floats(-1.0, 1.0)] * 3)
angles = st.tuples(*[st.floats(-3.0, 3.0)] * 3)


@given(channels=forces, a=lengths, b=lengths, az0=st.floats(-0.1, 0.0))
def test_the_wrench_is_that_of_the_data_sheet(
    channels: np.ndarray, a: float, b: float, az0: float
) -> None:
    wrench = plate_wrench_matrix(a, b, az0) @ channels
    np.testing.assert_allclose(wrench, kistler(channels, a, b, az0), atol=1e-9)


def test_a_weight_on_the_surface_gives_its_position() -> None:
    """The data sheet has ax = -My' / Fz and ay = Mx' / Fz for a weight at (ax, ay)."""
    sensors = np.array([(0.12, 0.2), (-0.12, 0.2), (-0.12, -0.2), (0.12, -0.2)])
    shares = np.array([0.4, 0.3, 0.1, 0.2])
    channels = np.concatenate([np.zeros(4), 800.0 * shares])
    _, _, fz, mx, my, _ = plate_wrench_matrix(0.12, 0.2, -0.054) @ channels
    assert fz == pytest.approx(800.0)
    np.testing.assert_allclose((-my / fz, mx / fz), shares @ sensors, atol=1e-15)


@pytest.mark.parametrize(
    ("channels", "force"),
    [
        # 100 N along x on the surface: My about the sensors' plane is -0.054 m * 100 N = -5.4 N m
        # = 0.12 m * (-11.25 - 11.25 - 11.25 - 11.25) N
        ([50.0, 50.0, 0.0, 0.0, 11.25, -11.25, -11.25, 11.25], [100.0, 0.0, 0.0]),
        # 100 N along y: Mx is 0.054 m * 100 N = 5.4 N m = 0.2 m * (6.75 + 6.75 + 6.75 + 6.75) N
        ([0.0, 0.0, 50.0, 50.0, 6.75, 6.75, -6.75, -6.75], [0.0, 100.0, 0.0]),
    ],
)
def test_a_push_on_the_surface_has_no_moment_about_its_centre(
    channels: list[float], force: list[float]
) -> None:
    """The surface is 54 mm above the sensors, and z points down: az0 is -0.054 m."""
    wrench = plate_wrench_matrix(0.12, 0.2, -0.054) @ channels
    np.testing.assert_allclose(wrench, [*force, 0.0, 0.0, 0.0], atol=1e-12)


def test_the_base_wrench_is_opposite_to_the_wrench_on_the_plate() -> None:
    """Gravity acts along +z of this plate; the base pushes the robot up."""
    geometry = PlateGeometry.from_config(plate())
    standing = geometry.base_wrench(np.array([[0.0, 0.0, 0.0, 0.0, 250.0, 250.0, 250.0, 250.0]]))
    np.testing.assert_allclose(standing, [[0.0, 0.0, -1000.0, 0.0, 0.0, 0.0]], atol=1e-12)


def test_a_displaced_plate_adds_the_lever_arm() -> None:
    """The plate is turned by 90 degrees about z and moved: its x axis is the base's y axis."""
    geometry = PlateGeometry.from_config(
        plate(position_m=(0.3, 0.0, 0.1), rotation_rad=(0.0, 0.0, np.pi / 2.0), az0_m=0.0)
    )
    push = geometry.base_wrench(np.array([[-5.0, -5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]]))
    np.testing.assert_allclose(push, [[0.0, 10.0, 0.0, -0.1 * 10.0, 0.0, 0.3 * 10.0]], atol=1e-12)


@given(wrench=st.lists(st.floats(-1e3, 1e3), min_size=6, max_size=6), at=shifts, turned=angles)
def test_a_wrench_converted_to_channels_and_back_is_unchanged(
    wrench: list[float], at: tuple[float, ...], turned: tuple[float, ...]
) -> None:
    crosstalk = np.eye(8) + 0.02 * np.sin(np.arange(64.0)).reshape(8, 8)
    geometry = PlateGeometry.from_config(
        plate(position_m=at, rotation_rad=turned, sensitivity=tuple(map(tuple, crosstalk)))
    )
    wanted = np.array([wrench])
    found = geometry.base_wrench(geometry.channels(wanted))
    np.testing.assert_allclose(found, wanted, atol=1e-8)


@given(channels=forces)
def test_crosstalk_is_compensated(channels: np.ndarray) -> None:
    crosstalk = np.eye(8) + 0.03 * np.cos(np.arange(64.0)).reshape(8, 8)
    mixed = PlateGeometry.from_config(plate(sensitivity=tuple(map(tuple, crosstalk))))
    straight = PlateGeometry.from_config(plate())
    np.testing.assert_allclose(
        mixed.base_wrench((crosstalk @ channels)[np.newaxis]),
        straight.base_wrench(channels[np.newaxis]),
        atol=1e-8,
    )
