"""A timed path gives one set-point per row, and is accepted only for the robot and cycle time for
which it was made.
"""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.motion.kinds.timed_path import TimedPathMotion, TimedWay
from config.errors import ConfigError
from config.load import load_robot
from tests.builders.raised_codes import raises_code, raises_invalid

ROBOT = load_robot("ir361")
T = 0.008


TAU = np.linspace(0.0, 1.0, 126)
WAY = {
    "points": ((0.0, 0.0, 0.0), (0.05, 0.0, 0.0), (0.1, 0.0, 0.0)),
    "length": (0.0, 0.5, 1.0),
    "place": tuple(TAU**3 * (10.0 - 15.0 * TAU + 6.0 * TAU**2)),
    "speed": tuple(30.0 * TAU**2 * (1.0 - TAU) ** 2),
    "acceleration": tuple(60.0 * TAU * (1.0 - TAU) * (1.0 - 2.0 * TAU)),
}
"""A move of axis 1 by 0.1 rad, slow enough for every limit."""


def timed_path(**changes: object) -> TimedPathMotion:
    document = {"kind": "timed_path", "robot": "ir361", "cycle_time_s": T, "ways": (WAY | changes,)}
    return TimedPathMotion.model_validate(document)


def test_a_timed_path_runs_from_rest_to_rest() -> None:
    samples = timed_path().plan(ROBOT, T)
    np.testing.assert_allclose(samples.position[[0, -1], 0], [0.0, 0.1], atol=1e-12)
    assert samples.velocity[:, 0].max() == pytest.approx(0.1 * 30.0 / 16.0, rel=1e-3)
    assert not samples.velocity[[0, -1]].any()


def test_another_cycle_time_is_refused() -> None:
    with raises_code(ConfigError, "RID-MOTION-CYCLE", "8 ms", "4 ms"):
        timed_path().plan(ROBOT, 0.004)


def test_poses_of_another_number_of_joints_are_refused() -> None:
    points = ((0.0, 0.0), (0.05, 0.0), (0.1, 0.0))
    with raises_code(ConfigError, "RID-MOTION-JOINTS", "part 1", "3 joints"):
        timed_path(points=points).plan(ROBOT, T)


def test_a_path_beyond_a_limit_is_refused() -> None:
    points = ((0.0, 0.0, 0.0), (0.0, 0.6, 0.0), (0.0, 1.2, 0.0))
    with raises_code(ConfigError, "RID-MOTION-LIMIT", "'axis2'", "1.2 rad"):
        timed_path(points=points).plan(ROBOT, T)


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({"speed": (0.5, *WAY["speed"][1:])}, ("speed", "0")),
        ({"acceleration": (*WAY["acceleration"][:-1], -0.5)}, ("acceleration", "0")),
        ({"length": (0.0, 0.5, 0.5)}, ("length",)),
        ({"place": (*WAY["place"][:-1], 1.1)}, ("place",)),
    ],
)
def test_a_path_that_does_not_start_and_end_at_rest_is_refused(
    changes: dict[str, object], names: tuple[str, ...]
) -> None:
    with raises_invalid("", *names):
        TimedWay.model_validate(WAY | changes)
