"""Motion files that are written from chosen poses, and the poses of such files."""

from __future__ import annotations

import json

import numpy as np
import pytest

from acquisition.motion.motion_file import AnyMotion, parse_motion
from config.errors import LimitError
from config.load import load_robot
from dynamics.geometry.kinematics import Chain, forward
from rid_daq.workbench.files.pose_list import Kind, PoseList
from tests.builders.raised_codes import raises_code

KR15 = load_robot("kr15")
POSES = ((0.0, 0.0, 0.0, 0.0, 0.5, 0.0), (0.3, 0.1, -0.1, 0.0, 0.6, 0.0), (0.4, 0, 0, 0, 0.4, 0))
SPEEDS: dict[Kind, float] = {"pose_sequence": 0.3, "joint_path": 0.5, "path": 0.1}


def motion_through(kind: Kind) -> AnyMotion:
    text = PoseList(kind=kind, points=POSES, speed=SPEEDS[kind], dwell_s=0.4).text(KR15)
    return parse_motion(text.encode(), "poses.yaml")


@pytest.mark.parametrize("kind", ["pose_sequence", "joint_path"])
def test_a_motion_in_joint_space_passes_through_the_poses(kind: Kind) -> None:
    position = motion_through(kind).plan(KR15, 0.004).whole(1).position
    for pose in POSES:
        assert np.abs(position - np.array(pose)).max(axis=1).min() < 0.01


def test_straight_lines_lead_the_tool_through_the_points_of_the_poses() -> None:
    chain = Chain.from_description(KR15)
    tool = forward(chain, motion_through("path").plan(KR15, 0.004).whole(1).position)
    for point in forward(chain, np.array(POSES)):
        assert np.linalg.norm(tool - point, axis=1).min() < 1e-4


@pytest.mark.parametrize("kind", list(SPEEDS))
def test_the_poses_of_a_written_motion_can_be_changed_again(kind: Kind) -> None:
    found = PoseList.of(motion_through(kind), KR15)
    assert found is not None
    assert (found.kind, found.speed, found.dwell_s) == (kind, SPEEDS[kind], 0.4)
    chain = Chain.from_description(KR15)
    expected, points = np.array(POSES), np.array(found.points)
    np.testing.assert_allclose(forward(chain, points), forward(chain, expected), atol=5e-5)
    if kind != "path":  # lines keep the orientation of the first pose
        np.testing.assert_allclose(points, expected, atol=1e-5)


def test_a_path_with_an_arc_is_no_list_of_poses() -> None:
    path = motion_through("path").model_dump(mode="json")
    arc = {"kind": "arc", "through_m": [1.0, 0.1, 1.0], "to_m": [1.0, 0.2, 1.1]}
    document = {**path, "segments": [*path["segments"], arc]}
    assert PoseList.of(parse_motion(json.dumps(document).encode(), "arc.yaml"), KR15) is None


def test_a_pose_outside_the_limits_is_refused() -> None:
    poses = PoseList(kind="pose_sequence", points=((9.0,) * 6,), speed=0.3, dwell_s=1.0)
    with raises_code(LimitError, "RID-MOTION-LIMIT", "9"):
        poses.text(KR15)


def test_a_pose_at_a_limit_stays_within_it() -> None:
    most = tuple(each.limits.position_max for each in KR15.joints)
    text = PoseList(kind="joint_path", points=(most, POSES[0]), speed=0.3, dwell_s=1.0).text(KR15)
    found = PoseList.of(parse_motion(text.encode(), "poses.yaml"), KR15)
    assert found is not None
    assert (np.array(found.points[0]) <= np.array(most)).all()
