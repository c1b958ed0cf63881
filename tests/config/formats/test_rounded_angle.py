"""Rounded angles near a multiple of 15 degrees become exact; others are unchanged."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.formats.rounded_angle import AngleReading, angle_notes

DEGREE = math.pi / 180.0


@pytest.mark.parametrize(
    ("written", "degrees"),
    [
        *((1.57, 90), (-1.57, -90), (1.571, 90), (1.5708, 90), (1.5707, 90), (3.14, 180)),
        *((3.1416, 180), (4.71, 270), (4.712, 270), (0.785, 45), (1.047, 60), (0.524, 30)),
        *((2.356, 135), (0.262, 15), (1.57079632679, 90), (1.5707963705062866, 90)),
    ],
)
def test_a_rounded_multiple_of_15_degrees_is_exact(written: float, degrees: float) -> None:
    reading = AngleReading.of(written)
    assert reading.used_rad == pytest.approx(degrees * DEGREE, abs=1e-15)
    assert not reading.is_doubtful


def test_a_number_of_numpy_is_read_as_its_plain_number() -> None:
    reading = AngleReading.of(np.float64(1.5708))
    assert reading == AngleReading.of(1.5708)
    assert "1.5708 rad" in angle_notes([("r.urdf:3", reading)])[0]
    assert "np." not in angle_notes([("r.urdf:3", reading)])[0]


@pytest.mark.parametrize("written", [1.5702964, 1.5701, 1.5711588, 1.57079634, 0.0005, 0.7858123])
def test_a_calibrated_angle_is_unchanged_and_named(written: float) -> None:
    reading = AngleReading.of(written)
    assert reading.used_rad == written
    assert reading.is_doubtful
    assert angle_notes([("r.urdf:3", reading)])


@pytest.mark.parametrize("written", [0.0, math.pi, math.pi / 2, math.pi / 4, 0.3, 1.0, 1.6, 0.26])
def test_an_exact_or_a_different_angle_is_not_mentioned(written: float) -> None:
    reading = AngleReading.of(written)
    assert reading.used_rad == written
    assert angle_notes([("r.urdf:3", reading)]) == []
