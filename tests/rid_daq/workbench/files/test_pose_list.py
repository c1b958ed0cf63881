"""Motion files that are written from chosen poses, and the poses of such files."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from acquisition.motion.motion_file import AnyMotion, parse_motion
from config.errors import ConfigError, LimitError
from config.load import load_robot
from dynamics.geometry.kinematics import Chain, forward
from rid_daq.workbench.files.pose_forms import FORMS, Kind
from rid_daq.workbench.files.pose_list import PoseList
from tests.builders.raised_codes import raises_code

KR15 = load_robot("kr15")
POSES = ((0.0, 0.0, 0.0, 0.0, 0.5, 0.0), (0.3, 0.1, -0.1, 0.0, 0.6, 0.0), (0.4, 0, 0, 0, 0.4, 0))
SETTINGS: dict[Kind, dict[str, float | tuple[float, ...]]] = {
    "pose_sequence": {"speed_fraction": 0.25, "dwell_s": 0.4},
    "joint_path": {"speed_fraction": 0.4, "dwell_s": 0.4},
    "path": {"speed_m_s": 0.15, "dwell_s": 0.4},
    "circle": {"speed_m_s": 0.15, "radius_m": 0.08, "normal": (1.0, 0.0, 0.0), "periods": 3},
}


def poses_of(kind: Kind, points: tuple[tuple[float, ...], ...] = POSES) -> PoseList:
    return PoseList(kind=kind, points=points[: FORMS[kind].most], settings=SETTINGS[kind])


def motion_through(kind: Kind) -> AnyMotion:
    return parse_motion(poses_of(kind).text(KR15).encode(), "poses.yaml")


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


def test_the_tool_turns_on_a_circle_about_the_point_of_the_pose() -> None:
    chain = Chain.from_description(KR15)
    centre = forward(chain, np.array(POSES[:1]))[0]
    tool = forward(chain, motion_through("circle").plan(KR15, 0.004).whole(1).position) - centre
    np.testing.assert_allclose(np.linalg.norm(tool, axis=1), 0.08, atol=1e-4)
    np.testing.assert_allclose(tool[:, 0], 0.0, atol=1e-4)  # vertical: y and z


@pytest.mark.parametrize("kind", list(SETTINGS))
def test_the_poses_of_a_written_motion_can_be_changed_again(kind: Kind) -> None:
    found = PoseList.of(motion_through(kind), KR15)
    assert found is not None
    assert (found.kind, found.settings) == (kind, SETTINGS[kind])
    chain = Chain.from_description(KR15)
    expected, points = np.array(POSES[: FORMS[kind].most]), np.array(found.points)
    np.testing.assert_allclose(forward(chain, points), forward(chain, expected), atol=5e-5)
    if kind != "path":  # lines keep the orientation of the first pose
        np.testing.assert_allclose(points, expected, atol=1e-5)


ARC = {"kind": "arc", "through_m": [1.0, 0.1, 1.0], "to_m": [1.0, 0.2, 1.1]}
SLOW = {"kind": "line", "to_m": [1.0, 0.2, 1.1], "speed_m_s": 0.01}


@pytest.mark.parametrize(
    ("kind", "more"),
    [
        ("path", {"segments": [ARC]}),
        ("path", {"segments": [SLOW]}),
        ("path", {"blend_m": 0.01}),
        ("joint_path", {"jerk_time_s": 0.3}),
        ("circle", {"normal": [0, 0.6, 0.8]}),
        ("circle", {"ramp_s": 3.0}),
    ],
)
def test_a_motion_with_more_than_poses_and_settings_is_not_changed(
    kind: Kind, more: dict[str, Any]
) -> None:
    document = motion_through(kind).model_dump(mode="json")
    changed = parse_motion(json.dumps({**document, **more}).encode(), "more.yaml")
    assert PoseList.of(changed, KR15) is None


def test_a_pose_outside_the_limits_is_refused() -> None:
    with raises_code(LimitError, "RID-MOTION-LIMIT", "9"):
        poses_of("pose_sequence", ((9.0,) * 6,)).text(KR15)


def test_a_circle_has_one_pose() -> None:
    poses = PoseList(kind="circle", points=POSES, settings=SETTINGS["circle"])
    with raises_code(ConfigError, "RID-PATH-SEGMENT", "3 poses"):
        poses.text(KR15)


def test_settings_of_another_kind_are_refused() -> None:
    poses = PoseList(kind="circle", points=POSES[:1], settings=SETTINGS["path"])
    with raises_code(ConfigError, "RID-REQUEST-INVALID", "dwell_s"):
        poses.text(KR15)


def test_a_pose_at_a_limit_stays_within_it() -> None:
    most = tuple(each.limits.position_max for each in KR15.joints)
    text = poses_of("joint_path", (most, POSES[0])).text(KR15)
    found = PoseList.of(parse_motion(text.encode(), "poses.yaml"), KR15)
    assert found is not None
    assert (np.array(found.points[0]) <= np.array(most)).all()
