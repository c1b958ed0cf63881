"""Bundled files load; errors are reported with file, line, column and allowed values."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from config.errors import ConfigError
from config.load import bundled_names, load_cell, load_robot, read_named
from tests.builders.raised_codes import raises_code

VALUE = "RID-FILE-VALUE"


def test_every_bundled_cell_and_robot_loads() -> None:
    assert "ir361" in bundled_names("cells")
    assert {"ir361", "ur10e"} <= set(bundled_names("robots"))
    for name in bundled_names("cells"):
        assert load_cell(name).config.name == name
    for name in bundled_names("robots"):
        assert load_robot(name).name == name


@pytest.mark.parametrize("make", [os.mkfifo, Path.mkdir])
def test_a_path_that_is_not_a_file_is_refused_at_once(
    tmp_path: Path, make: Callable[[Path], None]
) -> None:
    make(tmp_path / "cell.yaml")
    with raises_code(ConfigError, "RID-FILE-READ", "cell.yaml"):
        load_cell(str(tmp_path / "cell.yaml"))


def test_a_cell_file_finds_the_files_that_it_names_in_its_folder(tmp_path: Path) -> None:
    files = load_cell("ir361").files
    for name, text in files.items():
        (tmp_path / name).write_bytes(text)
    cell = (tmp_path / "cell.yaml").read_text()
    cell = cell.replace("robot: ir361", "robot: robot.yaml")
    (tmp_path / "cell.yaml").write_text(cell.replace("plant: ir361", "plant: plant.yaml"))
    loaded = load_cell(str(tmp_path / "cell.yaml"))
    assert loaded.robot == load_robot("ir361")
    assert loaded.files["robot.yaml"] == files["robot.yaml"]


def test_the_bundled_payload_cell_has_a_coupled_wrist() -> None:
    loaded = load_cell("kr15")
    assert loaded.robot.coupling is not None
    assert loaded.plant is not None


@pytest.mark.parametrize("side", ["master", "drive"])
def test_a_heartbeat_timeout_tolerates_one_late_heartbeat(tmp_path: Path, side: str) -> None:
    text = load_cell("ir361").files["cell.yaml"].decode()
    path = tmp_path / "cell.yaml"
    for beat_ms in (45, 46):
        beats = f"  {side}_heartbeat_ms: {beat_ms}\n  {side}_heartbeat_timeout_ms: 90\n"
        path.write_text(text.replace("drive_safety:\n", f"drive_safety:\n{beats}"))
        if beat_ms == 45:
            load_cell(str(path))
    keys = (f"{side}_heartbeat_ms", f"{side}_heartbeat_timeout_ms")
    with raises_code(ConfigError, "RID-FILE-VALUE", " drive_safety: ", *keys):
        load_cell(str(path))


@pytest.mark.fault(18)
@pytest.mark.parametrize("side", ["master", "drive"])
def test_a_heartbeat_timeout_above_100_ms_is_refused_for_a_real_cell(
    tmp_path: Path, side: str, measured: Callable[[str], None]
) -> None:
    text = load_cell("ir361").files["cell.yaml"].decode().replace("simulated: true\n", "")
    path = tmp_path / "cell.yaml"
    for timeout_ms in (100, 101):
        slow = f"drive_safety:\n  {side}_heartbeat_timeout_ms: {timeout_ms}\n"
        path.write_text(text.replace("drive_safety:\n", slow))
        if timeout_ms == 100:
            load_cell(str(path))
    with raises_code(ConfigError, "RID-FILE-VALUE", f"{side}_heartbeat_timeout_ms is", "100"):
        load_cell(str(path))
    measured("a heartbeat timeout above 100 ms on a real cell: refused")


def write_edited_cell(tmp_path: Path, old: str, new: str) -> str:
    text = load_cell("ir361").files["cell.yaml"].decode()
    assert old in text
    path = tmp_path / "cell.yaml"
    path.write_text(text.replace(old, new, 1))
    return str(path)


@pytest.mark.parametrize(
    ("old", "new", "code", "details"),
    [
        ("cycle_time_ms: 8", "cycle_time_ms: 8.0005", VALUE, (" cycle_time_ms: ", "8.0005")),
        ("cycle_time_ms: 8", "cycle_time_ms: 6.667", "RID-CELL-VALUE", ("60C2h", "6.6", "6.7")),
        ("cycle_time_ms: 8", "cycle_time_ms: '8'", VALUE, (" cycle_time_ms: ", "number", "'8'")),
        ("cycle_time_ms: 8", "cycle_time_m: 8", VALUE, (" cycle_time_m: ", "cycle_time_ms?")),
        ("cycle_time_ms: 8", "cycle_time_ms: 0", VALUE, (" cycle_time_ms: 0 ", "least 1")),
        ("node_id: 2", "node_id: 200", VALUE, (" axes.1.node_id: ", "126", "200")),
        ("node_id: 2", "node_id: 1", VALUE, ("node_id 1", "several axes")),
        ("robot: ir361", "robot: ir316", "RID-FILE-UNKNOWN", ("'ir316'", "ir361?")),
        ("robot: ir361", "robot: no/such.yaml", "RID-FILE-READ", ("no/such.yaml",)),
        ("plant: ir361", "", VALUE, ("simulated", "plant")),
    ],
)
def test_a_mistake_in_a_cell_is_reported_by_its_key(
    tmp_path: Path, old: str, new: str, code: str, details: tuple[str, ...]
) -> None:
    with raises_code(ConfigError, code, *details):
        load_cell(write_edited_cell(tmp_path, old, new))


def test_the_position_points_at_the_key(tmp_path: Path) -> None:
    path = write_edited_cell(tmp_path, "cycle_time_ms: 8", "cycle_time_ms: eight")
    lines = Path(path).read_text().splitlines()
    line = next(i for i, text in enumerate(lines, start=1) if text.startswith("cycle_time_ms"))
    with pytest.raises(ConfigError) as caught:
        load_cell(path)
    assert str(caught.value).startswith(f"{path}:{line}:1: cycle_time_ms: ")


def test_an_unknown_cell_lists_the_bundled_ones() -> None:
    with raises_code(ConfigError, "RID-FILE-UNKNOWN", "cells", "ir361"):
        load_cell("nothing-like-it")
    with raises_code(ConfigError, "RID-FILE-UNKNOWN", "'ur10e'", "Robot.load"):
        load_cell("ur10e")


@pytest.mark.parametrize(
    ("home", "code", "details"),
    [
        ("[0.0, 0.0]", VALUE, ("2 positions", "3 axes")),
        ("[0.0, 0.0, 9.0]", "RID-CELL-VALUE", ("home: axis3", " 9,")),
    ],
)
def test_a_home_pose_outside_the_limits_is_refused(
    home: str, code: str, details: tuple[str, ...], tmp_path: Path
) -> None:
    text = read_named("ir361", "cells", None)[0].decode()
    path = tmp_path / "cell.yaml"
    path.write_text(re.sub(r"^home: \[.*\]", f"home: {home}", text, flags=re.MULTILINE))
    with raises_code(ConfigError, code, *details):
        load_cell(str(path))
