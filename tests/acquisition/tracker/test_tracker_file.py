"""Tracker files: a point over time, with columns named by the header."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.tracker.tracker_file import read_tracked_point
from config.errors import ConfigError
from tests.builders.raised_codes import raises_code

ROWS = ("0.0,1.5,-0.25,0.125", "0.01,1.6,-0.25,0.125", "0.5,1.7,-0.25,0.125")


def save(folder: Path, *lines: str, encoding: str = "utf-8") -> Path:
    path = folder / "tracker.csv"
    path.write_text("\n".join((*lines, "")), encoding=encoding)
    return path


def test_metres_are_read_with_gaps_and_any_rate(tmp_path: Path) -> None:
    found = read_tracked_point(save(tmp_path, "time_s,x_m,y_m,z_m", *ROWS))
    np.testing.assert_array_equal(found.time_s, [0.0, 0.01, 0.5])
    np.testing.assert_array_equal(found.point_m[:, 0], [1.5, 1.6, 1.7])
    assert found.sigma_m is None
    assert found.left_out == 0


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_millimetres_decimal_commas_comments_and_other_columns_are_read(
    tmp_path: Path, encoding: str
) -> None:
    path = save(
        tmp_path,
        "# time_s;target;x_mm;y_mm;z_mm;sigma_mm;valid",
        "0,0;ball 1;1500,5;-250;125;0,02;1",
        "% beam lost",
        "0,1;ball 1;;;;;0",
        "0,2;ball 1;1600,5;-250;125;0,03;1",
        encoding=encoding,
    )
    found = read_tracked_point(path)
    np.testing.assert_allclose(found.point_m, [[1.5005, -0.25, 0.125], [1.6005, -0.25, 0.125]])
    assert found.sigma_m is not None
    np.testing.assert_allclose(found.sigma_m, [2e-5, 3e-5])
    np.testing.assert_array_equal(found.time_s, [0.0, 0.2])
    assert found.left_out == 1


@pytest.mark.parametrize(
    ("lines", "code", "place"),
    [
        ((), "RID-TRACKER-COLUMNS", "tracker.csv"),
        (ROWS, "RID-TRACKER-COLUMNS", "tracker.csv:1"),
        (("time_s,x_m,y_m,z_m",), "RID-TRACKER-ROW", "tracker.csv"),
        (("time_s,x_m,y_m,zm", *ROWS), "RID-TRACKER-COLUMNS", "z_m"),
        (("time_s,x_m,y_m,y_m", *ROWS), "RID-TRACKER-COLUMNS", "y_m"),
        (("time_s,x_m,y_m,z_mm", *ROWS), "RID-TRACKER-COLUMNS", "z_mm"),
        (("t,x_m,y_m,z_m", *ROWS), "RID-TRACKER-COLUMNS", "time_s"),
        (("time_s,x_m,y_m,z_m", *ROWS, "0.6,1,1"), "RID-TRACKER-ROW", "tracker.csv:5"),
        (("time_s,x_m,y_m,z_m", *ROWS, "0.6,1,1,one"), "RID-FILE-NUMBER", "tracker.csv:5: z_m"),
        (("time_s,x_m,y_m,z_m", *ROWS, "0.6,1,1,"), "RID-TRACKER-ROW", "tracker.csv:5: z_m"),
        (("time_s,x_m,y_m,z_m", *ROWS, "0.6,1,1,1_0"), "RID-FILE-NUMBER", "tracker.csv:5: z_m"),
        (("time_s,x_m,y_m,z_m", *ROWS, "0.6,1,1,1800"), "RID-TRACKER-ROW", "tracker.csv:5: z_m"),
        (("time_s,x_m,y_m,z_m", *ROWS, "0.4,1,1,1"), "RID-TRACKER-ROW", "tracker.csv:5"),
        (("time_s,x_m,y_m,z_m", *ROWS, "0.5,1,1,1"), "RID-TRACKER-ROW", "tracker.csv:5"),
        (
            ("time_s;x_m;y_m;z_m", "0,1;1,5;1.5;1", "0,2;1,5;1,5;1"),
            "RID-TRACKER-ROW",
            "tracker.csv:2: y_m",
        ),
        (("time_s,x_m,y_m,z_m,valid", "0,1,1,1,2"), "RID-TRACKER-ROW", "tracker.csv:2"),
        (("time_s,x_m,y_m,z_m,sigma_m", "0,1,1,1,0", "1,1,1,1,1e-5"), "RID-TRACKER-ROW", ":2"),
    ],
)
def test_an_unreadable_file_is_refused_at_its_line(
    tmp_path: Path, lines: tuple[str, ...], code: str, place: str
) -> None:
    with raises_code(ConfigError, code, place):
        read_tracked_point(save(tmp_path, *lines))


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with raises_code(ConfigError, "RID-FILE-READ", "none.csv"):
        read_tracked_point(tmp_path / "none.csv")
