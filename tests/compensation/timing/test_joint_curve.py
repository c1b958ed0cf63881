"""Geometry of a motion without its timing."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.motion.kinds.joint_path import JointPathMotion
from acquisition.motion.motion_file import MotionFile
from acquisition.motion.samples import MotionSamples, Phase
from compensation.timing.joint_curve import curves_of
from config.errors import ConfigError
from config.load import load_robot
from tests.builders.raised_codes import raises_code

POINTS = ((0.0, 0.0, 0.0), (0.4, 0.3, -0.2), (0.8, -0.1, 0.3), (0.2, 0.2, 0.5))
SPEEDS = [joint.limits.velocity for joint in load_robot("ir361").joints]


def planned(**more: object) -> MotionSamples:
    motion = JointPathMotion.model_validate(
        {"kind": "joint_path", "robot": "ir361", "points": POINTS, **more}
    )
    return motion.plan(load_robot("ir361"), 0.004)


def test_a_curve_contains_every_row_of_its_motion() -> None:
    samples = planned()
    rest_s, (way,) = curves_of(samples, SPEEDS)
    assert rest_s == pytest.approx(0.2, abs=0.01)
    assert way.rest_s == pytest.approx(0.2, abs=0.01)
    assert way.off < 1e-6
    begin, end = way.curve.ends
    position, slope, bend = way.curve.at(np.linspace(begin, end, 50))
    np.testing.assert_allclose(position[[0, -1]], samples.position[[0, -1]], atol=1e-9)
    assert np.isfinite(bend).all()
    assert (np.linalg.norm(slope / SPEEDS, axis=1) > 0.9).all()


def test_a_slower_motion_gives_the_same_curve() -> None:
    fast, slow = (curves_of(planned(speed_fraction=x), SPEEDS)[1][0].curve for x in (0.8, 0.3))
    np.testing.assert_allclose(fast.ends, slow.ends, rtol=1e-4)
    at = np.linspace(*slow.ends, 40)
    np.testing.assert_allclose(
        fast.at(at * fast.ends[1] / slow.ends[1])[0], slow.at(at)[0], atol=1e-4
    )


def test_a_path_that_stops_at_corners_is_split_there() -> None:
    motion = MotionFile.model_validate(
        {
            "kind": "path",
            "robot": "ir361",
            "start_m": (0.6, -0.2, -1.7),
            "near": (0.1, -0.1, 0.4),
            "speed_m_s": 0.4,
            "dwell_s": 0.1,
            "segments": (
                {"kind": "line", "to_m": (0.6, 0.1, -1.7)},
                {"kind": "line", "to_m": (0.8, 0.1, -1.7)},
            ),
        }
    ).root
    samples = motion.plan(load_robot("ir361"), 0.004)
    _, ways = curves_of(samples, SPEEDS)
    assert len(ways) == 2
    assert ways[0].rest_s == pytest.approx(0.1, abs=0.01)
    corner, begin = ways[0].curve, ways[1].curve
    np.testing.assert_allclose(
        corner.at(np.array([corner.ends[1]]))[0], begin.at(np.array([0.0]))[0], atol=1e-9
    )


def test_a_path_that_reverses_is_split_there() -> None:
    """No row of the motion is exactly at the pose at which it reverses."""
    first, turn = POINTS[:2]
    samples = planned(points=(first, turn, first))
    _, ways = curves_of(samples, SPEEDS)
    forward, backward = (way.curve for way in ways)
    np.testing.assert_allclose(forward.at(np.array(forward.ends))[0], [first, turn], atol=1e-6)
    np.testing.assert_allclose(backward.at(np.array(backward.ends))[0], [turn, first], atol=1e-6)
    assert ways[0].rest_s == 0.0


def at_rest(rows: np.ndarray) -> MotionSamples:
    zero = np.zeros_like(rows)
    return MotionSamples(
        ("a", "b", "c"), 0.004, rows, zero, zero, np.full(len(rows), Phase.MAIN, np.uint8)
    )


def test_a_motion_without_travel_is_refused() -> None:
    with raises_code(ConfigError, "RID-TIMING-SHAPE"):
        curves_of(at_rest(np.zeros((20, 3))), SPEEDS)


def spiral(turns: float, rows: int) -> MotionSamples:
    """Return a motion from rest to rest: circles of joints 1 and 2 while joint 3 advances."""
    share = np.linspace(0.0, 1.0, rows)
    place = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    angle = 2.0 * np.pi * turns * place
    position = np.stack([0.3 * np.sin(angle), 0.3 * np.cos(angle), place], axis=1)
    velocity = np.gradient(position, 0.004, axis=0)
    velocity[[0, -1]] = 0.0
    phase = np.full(rows, Phase.MAIN, np.uint8)
    return MotionSamples(("a", "b", "c"), 0.004, position, velocity, 0.0 * velocity, phase)


def test_a_long_path_has_more_poses() -> None:
    _, (way,) = curves_of(spiral(150.0, 20_000), SPEEDS)
    assert 1000 < len(way.curve.curve.x) <= 8001
    assert way.off < 2e-4


def test_a_path_too_long_or_too_jagged_is_refused_with_the_reason() -> None:
    with raises_code(ConfigError, "RID-TIMING-SHAPE", "8,000"):
        curves_of(spiral(1500.0, 60_000), SPEEDS)
    with raises_code(ConfigError, "RID-TIMING-SHAPE"):
        curves_of(spiral(150.0, 900), SPEEDS)
