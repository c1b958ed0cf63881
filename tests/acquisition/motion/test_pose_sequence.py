"""Pose sequences: the robot rests at each of the given poses, and the moves stay within the
limits.
"""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.motion.approach import approach
from acquisition.motion.kinds.pose_sequence import PoseSequenceMotion
from config.errors import ConfigError, LimitError, RidDaqError
from config.load import load_robot
from tests.builders.raised_codes import raises_code

ROBOT = load_robot("ir361")
POSES = ((0.0, 0.0, 0.0), (0.5, -0.3, 0.4), (-1.0, 0.6, 1.5))
PERIOD_S = 0.004


def sequence(
    points: tuple[tuple[float, ...], ...] = POSES, dwell_s: float = 2.0
) -> PoseSequenceMotion:
    return PoseSequenceMotion(kind="pose_sequence", robot="ir361", points=points, dwell_s=dwell_s)


def test_the_robot_rests_at_each_pose() -> None:
    samples = sequence().plan(ROBOT, PERIOD_S).whole()
    still = np.abs(samples.velocity).max(axis=1) == 0.0
    for pose in POSES:
        here = np.abs(samples.position - pose).max(axis=1) < 1e-12
        assert (here & still).sum() >= 2.0 / PERIOD_S
    speed = np.abs(samples.velocity) / [joint.limits.velocity for joint in ROBOT.joints]
    assert 0.2 < speed.max() <= 0.3


def test_moves_keep_the_speed_limits_of_coupled_motors() -> None:
    coupling = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -4.0, 1.0))
    robot = ROBOT.model_copy(update={"coupling": coupling})
    limits = [joint.limits.velocity for joint in ROBOT.joints]
    start, end = np.array(POSES[1]), np.array(POSES[2])
    for samples in (
        sequence().plan(robot, PERIOD_S).whole(),
        approach(start, end, robot, PERIOD_S),
    ):
        motors = samples.velocity @ np.linalg.inv(coupling).T
        speed = np.abs(motors) / limits
        assert 0.28 < speed.max() <= 0.3


@pytest.mark.parametrize(
    ("points", "kind", "code"),
    [
        (((0.0, 0.0), (0.1, 0.1)), ConfigError, "RID-MOTION-JOINTS"),
        ((POSES[0], (0.0, 0.0, 2.5)), LimitError, "RID-MOTION-LIMIT"),
    ],
)
def test_wrong_poses_are_refused(
    points: tuple[tuple[float, ...], ...], kind: type[RidDaqError], code: str
) -> None:
    with raises_code(kind, code, "point 1" if kind is ConfigError else "point 2"):
        sequence(points).plan(ROBOT, PERIOD_S)


def test_a_sequence_that_takes_too_long_is_refused() -> None:
    with raises_code(ConfigError, "RID-MOTION-LONG", "14400"):
        sequence(POSES * 10, dwell_s=600.0).plan(ROBOT, PERIOD_S)
