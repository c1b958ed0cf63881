"""Alignment: clock and frame of an instrument are found from the path itself."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from acquisition.tracker.alignment import Alignment, align
from acquisition.tracker.tracker_file import TrackedPoint
from config.arrays import FloatArray
from config.errors import DataQualityError
from tests.builders.raised_codes import raises_code

TURN = Rotation.from_rotvec([0.1, -0.2, 2.0]).as_matrix()
ORIGIN_M = np.array([2.0, -1.0, 0.5])
TIME_S = np.arange(0.0, 20.0, 0.004)


def path(time_s: FloatArray) -> FloatArray:
    """Return the points (m, 3) of a path that rests at both ends; all values are in m."""
    x = np.clip(time_s / 18.0 - 0.05, 0.0, 1.0)
    s = 18.0 * (10.0 * x**3 - 15.0 * x**4 + 6.0 * x**5)
    return np.column_stack(
        [0.8 + 0.3 * np.sin(1.1 * s), 0.4 * np.sin(0.7 * s), 0.6 + 0.2 * np.cos(1.7 * s)]
    )


def tracked(
    rate_hz: float, offset_s: float, rate: float, noise_m: float = 5e-5, begin_s: float = -1.0
) -> TrackedPoint:
    """Return the path in the frame and with the clock of an instrument.

    The points between 8 s and 9.5 s are missing.
    """
    random = np.random.default_rng(1)
    own = np.arange(begin_s, 21.0, 1.0 / rate_hz)
    own = own[(own < 8.0) | (own > 9.5)]  # the beam was interrupted
    points = path(own) @ TURN.T + ORIGIN_M + noise_m * random.normal(size=(len(own), 3))
    return TrackedPoint(own * (1.0 + rate) + offset_s, points)


def found_clock(found: Alignment) -> FloatArray:
    """Return the times of the run at 1000 s and 1015 s of the instrument's clock."""
    return found.run_time(np.array([1000.0, 1015.0]))


@pytest.mark.parametrize("rate_hz", [1000.0, 250.0, 20.0])
@pytest.mark.parametrize("rate", [0.0, 2e-4])
def test_clock_and_frame_are_found(rate_hz: float, rate: float) -> None:
    found = align(tracked(rate_hz, 998.0, rate), TIME_S, path(TIME_S))
    true = (np.array([1000.0, 1015.0]) - 998.0) / (1.0 + rate)
    np.testing.assert_allclose(found_clock(found), true, atol=2e-4)
    np.testing.assert_allclose(found.rotation, TURN, atol=2e-4)
    np.testing.assert_allclose(found.origin_m, ORIGIN_M, atol=2e-4)
    assert found.residual_m == pytest.approx(np.sqrt(3.0) * 5e-5, rel=0.15)
    np.testing.assert_allclose(
        found.to_base(path(TIME_S) @ TURN.T + ORIGIN_M), path(TIME_S), atol=5e-4
    )


def test_a_part_of_the_motion_is_enough() -> None:
    found = align(tracked(250.0, -3.0, 0.0, begin_s=9.6), TIME_S, path(TIME_S))
    assert found.run_time(np.array([10.0]))[0] == pytest.approx(13.0, abs=1e-3)


def test_another_path_is_refused() -> None:
    other = tracked(250.0, 0.0, 0.0)
    swapped = TrackedPoint(other.time_s, other.point_m[::-1] * [1.0, 0.5, 2.0])
    with raises_code(DataQualityError, "RID-TRACKER-ALIGNMENT"):
        align(swapped, TIME_S, path(TIME_S))


def test_a_point_at_rest_is_refused() -> None:
    rest = TrackedPoint(TIME_S, np.zeros((len(TIME_S), 3)))
    with raises_code(DataQualityError, "RID-TRACKER-ALIGNMENT"):
        align(rest, TIME_S, path(TIME_S))


def test_too_few_rows_are_refused() -> None:
    few = TrackedPoint(TIME_S[:5], path(TIME_S[:5]))
    with raises_code(DataQualityError, "RID-TRACKER-ALIGNMENT", "5 rows"):
        align(few, TIME_S, path(TIME_S))


def test_a_jump_of_the_clock_is_refused() -> None:
    seen = tracked(250.0, 1.7e9, 0.0)
    jumped = TrackedPoint(
        np.concatenate([[0.0], seen.time_s]), np.concatenate([seen.point_m[:1], seen.point_m])
    )
    with raises_code(DataQualityError, "RID-TRACKER-ALIGNMENT", "0 s"):
        align(jumped, TIME_S, path(TIME_S))


def small(time_s: FloatArray) -> FloatArray:
    """Return the points (m, 3) of a path of 20 mm."""
    return np.array([0.9, 0.1, 0.7]) + 0.05 * (path(time_s) - path(np.zeros(1)))


def seen(points: FloatArray, *, factor: float = 1.0, noise_m: float = 2e-5) -> TrackedPoint:
    """Return a path in the frame of an instrument, with noise, on the clock of the run."""
    noise = noise_m * np.random.default_rng(3).normal(size=points.shape)
    return TrackedPoint(TIME_S, factor * (points @ TURN.T + ORIGIN_M) + noise)


def test_a_small_path_with_soft_gears_is_accepted() -> None:
    bent = small(TIME_S) + 0.001 * np.sin(TIME_S[:, np.newaxis] * [1.0, 1.3, 1.7])
    found = align(seen(bent), TIME_S, small(TIME_S))
    assert found.residual_m == pytest.approx(0.001 * np.sqrt(1.5), rel=0.1)


@pytest.mark.parametrize(
    "wrong",
    [
        seen(np.tile(small(TIME_S[:1]), (len(TIME_S), 1))),
        seen(small(TIME_S)[::-1] * [1.0, 0.98, 1.02]),
        seen(small(TIME_S), factor=0.3937),
        seen(small(TIME_S) * [-1.0, 1.0, 1.0]),
        TrackedPoint(2.0 * TIME_S, seen(small(TIME_S)).point_m),
        TrackedPoint(1.05 * TIME_S, seen(small(TIME_S)).point_m),
    ],
    ids=["at rest", "another path", "tens of inches", "mirrored", "half speed", "slow clock"],
)
def test_a_small_path_hides_no_wrong_file(wrong: TrackedPoint) -> None:
    with raises_code(DataQualityError, "RID-TRACKER-ALIGNMENT"):
        align(wrong, TIME_S, small(TIME_S))


def test_a_mirrored_frame_is_refused_even_if_the_residual_is_small() -> None:
    flat = path(TIME_S) * [1.0, 1.0, 0.02]
    with raises_code(DataQualityError, "RID-TRACKER-ALIGNMENT", "left-handed"):
        align(seen(flat * [-1.0, 1.0, 1.0]), TIME_S, flat)
