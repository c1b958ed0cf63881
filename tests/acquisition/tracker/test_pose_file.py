"""Tables of poses: joint positions at rest and the point that was measured."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.tracker.pose_file import read_measured_poses
from config.errors import ConfigError
from config.load import load_robot
from tests.builders.raised_codes import raises_code

ROBOT = load_robot("ir361")


def save(folder: Path, *lines: str) -> Path:
    path = folder / "poses.csv"
    path.write_text("\n".join((*lines, "")), encoding="utf-8")
    return path


def test_joints_are_read_in_the_units_of_their_columns(tmp_path: Path) -> None:
    path = save(
        tmp_path,
        "pose,z_mm,y_mm,x_mm,axis3,axis1_deg,axis2_rad,load_kg,valid",
        "P1,300,200,100,0.5,90,-0.25,0,1",
        "P2,301,201,101,0.5,90,-0.25,8.5,1",
        "P3,,,,0.5,90,-0.25,8.5,0",
    )
    found = read_measured_poses(path, ROBOT)
    np.testing.assert_allclose(found.position, [[np.pi / 2, -0.25, 0.5]] * 2)
    np.testing.assert_allclose(found.point_m[0], [0.1, 0.2, 0.3])
    np.testing.assert_array_equal(found.load_kg, [0.0, 8.5])
    np.testing.assert_array_equal(found.rows, [2, 3])
    assert found.left_out == 1


@pytest.mark.parametrize(
    ("lines", "code", "place"),
    [
        (("axis1,axis2,x_m,y_m,z_m", "0,0,1,1,1"), "RID-TRACKER-COLUMNS", "axis3"),
        (
            ("axis1,axis1_deg,axis2,axis3,x_m,y_m,z_m", "0,0,0,0,1,1,1"),
            "RID-TRACKER-COLUMNS",
            "axis1_deg",
        ),
        (("axis1,axis2,axis3,x_m,y_m,z_m", "0,0,90,1,1,1"), "RID-TRACKER-ROW", "poses.csv:2"),
        (
            ("axis1,axis2,axis3,x_m,y_m,z_m,load_kg", "0,0,0,1,1,1,-1"),
            "RID-TRACKER-ROW",
            "poses.csv:2",
        ),
    ],
)
def test_a_wrong_table_is_refused_at_its_line(
    tmp_path: Path, lines: tuple[str, ...], code: str, place: str
) -> None:
    with raises_code(ConfigError, code, place):
        read_measured_poses(save(tmp_path, *lines), ROBOT)
