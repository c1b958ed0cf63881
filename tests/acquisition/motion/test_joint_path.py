"""Joint paths: curves through poses, and tables of positions in the motion file or in a planner's
file.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from acquisition.motion.kinds.joint_path import JointPathMotion
from acquisition.motion.kinds.joint_table import JointTableMotion
from acquisition.motion.limits import verify_limits
from acquisition.motion.motion_file import load_motion
from acquisition.motion.samples import Phase
from config.arrays import FloatArray
from config.errors import ConfigError, LimitError
from config.load import load_robot, to_yaml
from tests.builders.raised_codes import raises_code

ROBOT = load_robot("ir361")
T = 0.008
POINTS = ((0.0, 0.0, 0.0), (0.5, 0.3, -0.4), (1.0, -0.3, 0.4), (0.0, 0.2, 0.3))
HEADER = "axis2,time_s,axis1,axis3"


def joint_path(
    points: tuple[tuple[float, ...], ...] = POINTS, **changes: object
) -> JointPathMotion:
    fields = {"kind": "joint_path", "robot": "ir361", "points": points}
    return JointPathMotion.model_validate(fields | changes)


def table(rows: int = 201) -> list[tuple[float, float, float, float]]:
    x = np.linspace(0.0, 1.0, rows)
    share = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
    return list(zip(0.3 * share, 2.0 * x, 0.5 * share, -0.4 * share, strict=True))


def write_motion(folder: Path, lines: list[str]) -> Path:
    (folder / "path.csv").write_text("\n".join(lines) + "\n")
    motion = folder / "motion.yaml"
    motion.write_text("kind: joint_table\nrobot: ir361\nfile: path.csv\n")
    return motion


def csv(rows: list[tuple[float, float, float, float]]) -> list[str]:
    return [HEADER, *(",".join(f"{value:.7f}" for value in row) for row in rows)]


@pytest.mark.parametrize("fraction", [0.3, 1.0])
def test_a_curve_passes_its_poses_within_the_given_fraction_of_the_limits(fraction: float) -> None:
    samples = joint_path(speed_fraction=fraction).plan(ROBOT, T)
    verify_limits(samples, ROBOT)
    for pose in POINTS:
        gap = np.abs(samples.position - pose).max(axis=1).min()
        assert gap < 3.0 * T  # moved in one cycle at the joints' velocity limits
    assert (samples.position[0] == POINTS[0]).all()
    np.testing.assert_allclose(samples.position[-1], POINTS[-1], atol=1e-12)
    speed = np.abs(samples.velocity).max(axis=0) / [j.limits.velocity for j in ROBOT.joints]
    change = np.abs(samples.acceleration).max(axis=0) / [
        j.limits.acceleration for j in ROBOT.joints
    ]
    assert max(speed.max(), change.max()) <= fraction
    assert max(speed.max(), change.max()) > 0.6 * fraction
    np.testing.assert_allclose(
        np.diff(samples.position, axis=0) / T,
        (samples.velocity[1:] + samples.velocity[:-1]) / 2.0,
        atol=2e-3,
    )


def test_a_table_in_a_csv_file_is_followed_and_stored_in_the_motion(tmp_path: Path) -> None:
    motion = load_motion(write_motion(tmp_path, csv(table())))
    assert isinstance(motion, JointTableMotion)
    samples = motion.plan(ROBOT, T)
    main = samples.position[samples.phase == Phase.MAIN]
    wanted = np.array(table())
    times = np.arange(len(main)) * T
    for j, column in enumerate((2, 0, 3)):
        np.testing.assert_allclose(
            main[:, j], np.interp(times, wanted[:, 1], wanted[:, column]), atol=1e-4
        )
    again = tmp_path / "whole.yaml"
    again.write_text(to_yaml(motion))
    assert load_motion(again) == motion


@pytest.mark.parametrize(
    ("lines", "code", "details"),
    [
        (["axis1,axis2", "0,0"], "RID-TABLE-INVALID", ("path.csv:1: ", "time_s")),
        ([HEADER, "0,0,0"], "RID-TABLE-INVALID", ("path.csv:2: ", "3 columns", " 4")),
        ([HEADER, "0,zero,0,0"], "RID-FILE-NUMBER", ("path.csv:2: 'zero'",)),
        ([HEADER, "0,inf,0,0"], "RID-FILE-NUMBER", ("path.csv:2: 'inf'",)),
        (["axis2,time_s,axis1", *["0,1,0"] * 9], "RID-MOTION-JOINTS", ("axis1, axis2, axis3",)),
        (
            [HEADER, *[f"0,1,{0.1 * k},0" for k in range(9)]],
            "RID-TABLE-INVALID",
            ("row 2 ", " 1 s", "time"),
        ),
        ([HEADER, "0,0,0,0"], "RID-TABLE-INVALID", ("1 different rows", "6 ")),
        (
            csv([(a, t, b, 6.0 * c) for a, t, b, c in table()]),
            "RID-MOTION-LIMIT",
            ("row 102 ", "'axis3'", "-1.2 to 2.2"),
        ),
        (csv(table()[60:]), "RID-TABLE-INVALID", ("row 1 ", "'axis1'", "at rest")),
        (csv(table()[:100]), "RID-TABLE-INVALID", ("row 100 ", "'axis1'", "at rest")),
        (
            csv([(a, t / 20.0, b, c) for a, t, b, c in table()]),
            "RID-MOTION-LIMIT",
            ("velocity of joint", "9.37388 rad/s", "2.6"),
        ),
        (
            csv([(a, 1e3 * t, b, c) for a, t, b, c in table()]),  # ms
            "RID-TABLE-INVALID",
            ("2000 s", "0.018 %", "18 %", " ms "),
        ),
    ],
)
def test_an_invalid_table_is_refused_with_its_row(
    tmp_path: Path, lines: list[str], code: str, details: tuple[str, ...]
) -> None:
    with raises_code(ConfigError, code, *details):
        load_motion(write_motion(tmp_path, lines)).plan(ROBOT, T)


def test_a_table_that_accelerates_constantly_from_rest_is_accepted(tmp_path: Path) -> None:
    """The motion begins at rest, although the first two rows (0.1 s apart) differ in position."""
    t = np.linspace(0.0, 2.0, 21)
    ramp = np.where(t < 1.0, 0.5 * t**2, 1.0 - 0.5 * (2.0 - t) ** 2)
    rows = [(0.0, time, place, 0.4) for time, place in zip(t.tolist(), ramp.tolist(), strict=True)]
    samples = load_motion(write_motion(tmp_path, csv(rows))).plan(ROBOT, T)
    verify_limits(samples, ROBOT)
    main = samples.position[samples.phase == Phase.MAIN]
    np.testing.assert_allclose(
        main[::25, 0], np.interp(np.arange(0, 2.01, 0.2), t, ramp), atol=1e-3
    )


def test_a_repeated_row_is_skipped(tmp_path: Path) -> None:
    rows = csv(table())
    once = load_motion(write_motion(tmp_path, rows)).plan(ROBOT, T)
    twice = load_motion(write_motion(tmp_path, [*rows[:2], *rows[1:], rows[-1]])).plan(ROBOT, T)
    np.testing.assert_array_equal(once.position, twice.position)


PLANNED_S = np.array([0.0, 0.4, 0.7, 0.9, 1.2, 1.6, 2.0])
"""Times of the few rows of a planner's table [s]."""


def planned_rows() -> tuple[FloatArray, FloatArray]:
    """Return positions [rad] and velocities [rad/s] at `PLANNED_S`; the motion ends at rest."""
    x = PLANNED_S / 2.0
    share = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
    rate = 15.0 * x**2 * (1.0 - 2.0 * x + x**2)
    size = np.array([0.5, 0.3, -0.4])
    return share[:, np.newaxis] * size, rate[:, np.newaxis] * size


def planned_csv(folder: Path, names: str, velocity: FloatArray) -> Path:
    position, _ = planned_rows()
    rows = np.column_stack([PLANNED_S, position, velocity])
    return write_motion(folder, [names, *(",".join(map(repr, row)) for row in rows.tolist())])


def moveit_json(folder: Path, stamp: Callable[[float], object], key: str = "file.json") -> Path:
    position, velocity = planned_rows()
    points = [
        {"positions": q, "velocities": v, "accelerations": [], "time_from_start": stamp(t)}
        for q, v, t in zip(position.tolist(), velocity.tolist(), PLANNED_S.tolist(), strict=True)
    ]
    message = {"joint_names": ["axis1", "axis2", "axis3"], "points": points}
    tree = {"trajectory": [{"joint_trajectory": message}]}
    (folder / key).write_text(json.dumps(tree))
    motion = folder / "motion.yaml"
    motion.write_text(f"kind: joint_table\nrobot: ir361\nfile: {key}\n")
    return motion


VELOCITY_NAMES = (
    "time_s,axis1,axis2,axis3,axis1_velocity,axis2_velocity,axis3_velocity",
    "time_from_start,axis1,axis2,axis3,vel_axis1,vel_axis2,vel_axis3",
)


@pytest.mark.parametrize("names", VELOCITY_NAMES)
def test_positions_and_velocities_define_the_curve(tmp_path: Path, names: str) -> None:
    motion = load_motion(planned_csv(tmp_path, names, planned_rows()[1]))
    samples = motion.plan(ROBOT, T)
    verify_limits(samples, ROBOT)
    main = samples.phase == Phase.MAIN
    x = np.arange(main.sum()) * T / 2.0
    share = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
    np.testing.assert_allclose(
        samples.position[main], share[:, np.newaxis] * [0.5, 0.3, -0.4], atol=1e-9
    )
    again = tmp_path / "whole.yaml"
    again.write_text(to_yaml(motion))
    assert load_motion(again) == motion


def test_a_joint_at_rest_may_have_velocities_of_rounding(tmp_path: Path) -> None:
    path = planned_csv(tmp_path, VELOCITY_NAMES[0], planned_rows()[1])
    lines = [line.split(",") for line in (tmp_path / "path.csv").read_text().splitlines()]
    for line in lines[1:]:
        line[2], line[5] = "0.3", "1e-9"
    (tmp_path / "path.csv").write_text("\n".join(map(",".join, lines)))
    samples = load_motion(path).plan(ROBOT, T)
    np.testing.assert_allclose(samples.position[:, 1], 0.3, atol=1e-8)


def test_columns_of_accelerations_are_not_used(tmp_path: Path) -> None:
    path = planned_csv(tmp_path, VELOCITY_NAMES[0], planned_rows()[1])
    bare = load_motion(path)
    head, *lines = (tmp_path / "path.csv").read_text().split()
    head += ",acc_axis1,axis2_acceleration"
    (tmp_path / "path.csv").write_text("\n".join([head, *(f"{line},9,9" for line in lines)]))
    assert load_motion(path) == bare


@pytest.mark.parametrize(
    ("separator", "decimal", "encoding", "mark"),
    [
        (";", ",", "utf-16", ""),
        ("\t", ",", "utf-16-le", ""),
        ("; ", ".", "utf-8-sig", ""),
        (";;", ".", "utf-8", ""),  # one semicolon, and another one at the end of each row
        (" ", ".", "utf-8", "# "),
        ("','", ",", "utf-8", ""),  # quoted below
    ],
)
def test_tables_of_spreadsheets_are_read(
    tmp_path: Path, separator: str, decimal: str, encoding: str, mark: str
) -> None:
    motion = planned_csv(tmp_path, VELOCITY_NAMES[0], planned_rows()[1])
    expected = load_motion(motion)
    lines = (tmp_path / "path.csv").read_text().splitlines()
    text = "\n".join(line.replace(".", decimal) for line in _separated(lines, separator))
    (tmp_path / "path.csv").write_bytes((mark + text).encode(encoding))
    assert load_motion(motion) == expected


def _separated(lines: list[str], separator: str) -> list[str]:
    """Return lines with another separator; with `','`, all cells are in double quotes.

    With `;;`, a separator follows the last cell, too.
    """
    if separator == ";;":
        return [f"{line.replace(',', ';')};" for line in lines]
    if separator == "','":
        return [f'"{line.replace(",", "@")}"'.replace("@", '","') for line in lines]
    return [line.replace(",", separator) for line in lines]


def test_numbers_with_grouped_digits_are_refused_in_a_table(tmp_path: Path) -> None:
    motion = planned_csv(tmp_path, VELOCITY_NAMES[0], planned_rows()[1])
    text = (tmp_path / "path.csv").read_text().replace(",", ";").replace("\n0.4;", "\n1.000,4;", 1)
    (tmp_path / "path.csv").write_text(text)
    with raises_code(ConfigError, "RID-FILE-NUMBER", "path.csv:"):
        load_motion(motion)


def test_decimal_commas_between_commas_are_named(tmp_path: Path) -> None:
    motion = planned_csv(tmp_path, VELOCITY_NAMES[0], planned_rows()[1])
    text = (tmp_path / "path.csv").read_text().replace(".", ",")
    (tmp_path / "path.csv").write_text(text)
    with raises_code(ConfigError, "RID-TABLE-INVALID", "path.csv:2: ", "semicolons"):
        load_motion(motion)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
@pytest.mark.parametrize("key", ["file.json", "file.yaml"])
def test_a_trajectory_of_ros_may_be_utf_16(tmp_path: Path, key: str, encoding: str) -> None:
    motion = moveit_json(tmp_path, lambda t: t, key)
    expected = load_motion(motion)
    file = tmp_path / key
    file.write_bytes(file.read_text().encode(encoding))
    assert load_motion(motion) == expected


@pytest.mark.parametrize(
    ("key", "stamp"),
    [
        ("file.json", lambda t: {"sec": int(t), "nanosec": round((t - int(t)) * 1e9)}),
        ("file.json", lambda t: {"secs": int(t), "nsecs": round((t - int(t)) * 1e9)}),
        ("file.yaml", lambda t: t),
    ],
)
def test_a_trajectory_of_ros_is_read(
    tmp_path: Path, key: str, stamp: Callable[[float], object]
) -> None:
    samples = load_motion(moveit_json(tmp_path, stamp, key)).plan(ROBOT, T)
    same = load_motion(planned_csv(tmp_path, VELOCITY_NAMES[0], planned_rows()[1])).plan(ROBOT, T)
    np.testing.assert_allclose(samples.position, same.position, atol=1e-12)


def test_a_file_without_one_trajectory_is_refused(tmp_path: Path) -> None:
    motion = moveit_json(tmp_path, lambda t: t)
    text = (tmp_path / "file.json").read_text()
    for wrong, details in (
        (text.replace('"points"', '"waypoints"'), ("file.json", "points")),
        (text.replace('[{"joint_tr', '[{}, {"joint_tr'), ("file.json", "2")),
        (text.replace('"joint_names"', '"names"'), ("file.json", "joint_names")),
        (text.replace('"time_from_start": 0.7', '"time_from_start": "late"'), ("points.2",)),
        (text.replace('"velocities": [0.0, 0.0, -0.0]', '"velocities": []'), ("velocities",)),
        (text.replace('"velocities"', '"velocity"'), ("points.0.velocity",)),
        (
            text.replace(
                '"time_from_start": 0.7', '"time_from_start": {"sec": 0, "nanosecs": 700000000}'
            ),
            ("points.2", "nanosecs"),
        ),
        (
            text.replace('"time_from_start": 0.7', '"time_from_start": {"sec": 0, "nanosec": 7e9}'),
            ("points.2", "nanosec"),
        ),
        (text.replace('"time_from_start": 0.7', '"time_from_start": true'), ("points.2",)),
        (text.replace('"points"', '"units": "deg", "points"'), ("units",)),
    ):
        assert wrong != text
        (tmp_path / "file.json").write_text(wrong)
        with raises_code(ConfigError, "RID-TABLE-INVALID", *details):
            load_motion(motion)


@pytest.mark.parametrize(
    ("names", "factor", "details"),
    [
        (VELOCITY_NAMES[0].replace(",axis3_velocity", ",vel"), 1.0, ("path.csv:1: ", "axis3")),
        (VELOCITY_NAMES[0], 57.3, ("'axis1'", "0.0")),
        (VELOCITY_NAMES[0].replace("axis2_velocity", "vel_axis1"), 1.0, ("path.csv:1: ", "axis1")),
        (VELOCITY_NAMES[0], 573.0, ("velocity: ", "60 rad/s")),
        (VELOCITY_NAMES[0], -1.0, ("'axis1'", "-")),
        (VELOCITY_NAMES[1], 0.0, ("'axis1'", "vel_axis1")),
    ],
)
def test_velocities_that_contradict_the_positions_are_refused(
    tmp_path: Path, names: str, factor: float, details: tuple[str, ...]
) -> None:
    with raises_code(ConfigError, "RID-TABLE-INVALID", *details):
        load_motion(planned_csv(tmp_path, names, factor * planned_rows()[1])).plan(ROBOT, T)


def test_a_missing_or_empty_table_is_refused(tmp_path: Path) -> None:
    motion = write_motion(tmp_path, [])
    with raises_code(ConfigError, "RID-TABLE-INVALID"):
        load_motion(motion)
    (tmp_path / "path.csv").unlink()
    with raises_code(ConfigError, "RID-FILE-READ"):
        load_motion(motion)
    motion.write_text("kind: joint_table\nrobot: ir361\n")
    with raises_code(ConfigError, "RID-FILE-VALUE", "motion.yaml:1:1: ", "`file`", "time_s"):
        load_motion(motion)


@pytest.mark.parametrize(
    ("points", "code", "details"),
    [
        ((POINTS[0], POINTS[0]), "RID-PATH-SEGMENT", ("2 points",)),
        ((POINTS[0], (0.0, 0.0)), "RID-MOTION-JOINTS", ("point 2", "2 values")),
        (
            (POINTS[0], (0.0, 1.2, 0.0), POINTS[1]),
            "RID-MOTION-LIMIT",
            ("point 2", "'axis2'", "at 1.2", "-1.4 to 1"),
        ),
        (
            (POINTS[0], (0.0, 0.95, 0.0), (1.0, 0.95, 0.0), POINTS[0]),
            "RID-MOTION-LIMIT",
            ("points 2 and 3", "'axis2'", "-1.4 to 1"),
        ),
    ],
)
def test_unreachable_poses_are_refused(
    points: tuple[tuple[float, ...], ...], code: str, details: tuple[str, ...]
) -> None:
    with raises_code(ConfigError, code, *details):
        joint_path(points).plan(ROBOT, T)


@pytest.mark.parametrize("gap", [0.0, 1e-12, 1e-9, 9e-7])
def test_poses_that_an_encoder_does_not_distinguish_are_one(gap: float) -> None:
    usual = joint_path().plan(ROBOT, T)
    near = tuple(value + gap for value in POINTS[1])
    last = tuple(value - gap for value in POINTS[3])
    twice = joint_path((*POINTS[:2], near, POINTS[2], last, POINTS[3])).plan(ROBOT, T)
    np.testing.assert_allclose(twice.position, usual.position, atol=1e-9)


def test_a_cluster_of_points_beyond_the_resolution_of_encoders_is_named() -> None:
    near = ((0.4, 0.2, -0.3), (0.400002, 0.2, -0.3), (0.4, 0.200002, -0.3))
    motion = joint_path(((0.0, 0.0, 0.0), *near, (0.1, 0.5, 0.2)))
    with raises_code(LimitError, "RID-MOTION-LIMIT", " 2 ", " 3 "):
        motion.plan(ROBOT, T)
