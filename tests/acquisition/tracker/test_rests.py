"""Rests of a recording, and the poses of a table that belong to them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.motion.kinds.pose_sequence import PoseSequenceMotion
from acquisition.motion.samples import Phase
from acquisition.recording.recording import Recording
from acquisition.tracker.pose_file import read_measured_poses
from acquisition.tracker.rests import find_rests
from config.errors import DataQualityError
from config.load import load_robot
from tests.builders.raised_codes import raises_code

ROBOT = load_robot("ir361")
POSES = np.array([[0.0, 0.0, 0.0], [0.5, -0.3, 0.4], [-1.0, 0.6, 1.5], [0.2, 0.1, 0.3]])
SAG = np.array([0.0, 1e-3, -5e-4])
HEADER = "axis1,axis2,axis3,x_m,y_m,z_m"


@pytest.fixture(scope="module")
def recording() -> Recording:
    """Return a recording in which the drives hold the poses with an offset and noise."""
    motion = PoseSequenceMotion(
        kind="pose_sequence", robot="ir361", points=tuple(map(tuple, POSES.tolist())), dwell_s=1.0
    )
    target = motion.plan(ROBOT, 0.004).whole().position
    rows = len(target)
    noise = 1e-5 * np.random.default_rng(3).normal(size=target.shape)
    return Recording(
        joint_names=ROBOT.joint_names,
        time_s=0.004 * np.arange(rows, dtype=np.float64),
        position=target + SAG + noise,
        torque_nm=np.zeros_like(target),
        valid=np.ones(rows, dtype=np.bool_),
        phase=np.full(rows, Phase.MAIN, dtype=np.uint8),
        sample_index=np.arange(rows),
        source="cell",
        run_id="r1",
    )


def save(folder: Path, *lines: str) -> Path:
    path = folder / "poses.csv"
    path.write_text("\n".join((*lines, "")), encoding="utf-8")
    return path


def test_each_pose_is_a_rest_with_the_measured_position(recording: Recording) -> None:
    found = find_rests(recording)
    assert len(found) == 4
    np.testing.assert_allclose(found.position, POSES + SAG, atol=1e-5)
    assert (found.end_s - found.begin_s > 0.4).all()


def test_a_recording_without_a_rest_is_refused(recording: Recording) -> None:
    rows = len(recording.time_s)
    moving = Recording(
        joint_names=ROBOT.joint_names,
        time_s=recording.time_s,
        position=0.1 * recording.time_s[:, np.newaxis] * np.ones(3),
        torque_nm=np.zeros((rows, 3)),
        valid=recording.valid,
        phase=recording.phase,
        sample_index=recording.sample_index,
        source="cell",
        run_id="r2",
    )
    with raises_code(DataQualityError, "RID-TRACKER-RESTS", "r2"):
        find_rests(moving)


def test_poses_get_the_closest_rest(recording: Recording, tmp_path: Path) -> None:
    rests = find_rests(recording).position
    path = save(tmp_path, HEADER, "-1,0.6,1.5,1,1,1", "0.5,-0.3,0.4,1,1,1")
    found = read_measured_poses(path, ROBOT, rests)
    np.testing.assert_array_equal(found.position, rests[[2, 1]])
    path = save(tmp_path, HEADER, "-1,0.6,1.45,1,1,1")
    with raises_code(DataQualityError, "RID-TRACKER-RESTS", "poses.csv:2"):
        read_measured_poses(path, ROBOT, rests)


def test_points_alone_have_the_order_of_the_rests(recording: Recording, tmp_path: Path) -> None:
    rests = find_rests(recording).position
    rows = ["1,1,1,1", ",,,0", "1,1,2,1", "1,1,3,1"]
    found = read_measured_poses(save(tmp_path, "x_m,y_m,z_m,valid", *rows), ROBOT, rests)
    np.testing.assert_array_equal(found.position, rests[[0, 2, 3]])
    np.testing.assert_array_equal(found.point_m[:, 2], [1.0, 2.0, 3.0])
    with raises_code(DataQualityError, "RID-TRACKER-RESTS", "3 rows", "4 rests"):
        read_measured_poses(save(tmp_path, "x_m,y_m,z_m,valid", *rows[:3]), ROBOT, rests)
