"""Physical values in a wrong unit are refused with key, unit, range and likely mistake."""

from __future__ import annotations

import inspect
import re
import typing
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from annotated_types import Le, Lt
from pydantic import BaseModel

from acquisition.maps.import_map import ImportMap, load_import_map
from acquisition.motion.kinds.timed_path import TimedWay
from acquisition.motion.motion_file import MotionFile, load_motion
from config.cell.cell import CellConfig
from config.errors import ConfigError
from config.load import load_cell, load_robot
from config.plausible import Plausible
from config.robot.robot import RobotDescription
from config.simulation.plant import PlantConfig
from rid_daq.app import run
from tests.builders.raised_codes import raises_code


def bundled(kind: str, name: str = "ir361") -> str:
    return files("config").joinpath(f"bundled/{kind}/{name}.yaml").read_text()


def load_file(folder: Path, kind: str, text: str) -> None:
    """Write a text as a robot, cell, plant, motion or import map (`kind`), and load it."""
    path = folder / f"{kind}.yaml"
    path.write_text(text)
    if kind == "robot":
        load_robot(str(path))
    elif kind == "motion":
        load_motion(path)
    elif kind == "map":
        load_import_map(str(path))
    elif kind == "cell":
        load_cell(str(path))
    else:
        (folder / "cell.yaml").write_text(
            bundled("cells").replace("plant: ir361", "plant: plant.yaml")
        )
        load_cell(str(folder / "cell.yaml"))


def refusal(folder: Path, kind: str, text: str, *values: str) -> str:
    with raises_code(ConfigError, "RID-FILE-VALUE", *values) as caught:
        load_file(folder, kind, text)
    return str(caught.value)


MOTION = """
kind: path
robot: ir361
start_m: [0.8, 0.0, 1.0]
near: [0.0, 0.0, 0.0]
speed_m_s: 0.1
segments: [{kind: line, to_m: [0.9, 0.0, 1.0]}]
"""

MAP = """
name: arm
robot: ir361
columns: 7
rate_hz: 500.0
joints:
  - {joint: axis1, position: 1, current: 4, torque_constant_nm_per_a: 95.0, zero_offset: 1.5}
  - {joint: axis2, position: 2, torque: 5}
  - {joint: axis3, position: 3, torque: 6, gear_ratio: 101.0}
plausible: {position: 7.0, speed: 4.0, torque: 800.0}
period_s: 10.0
"""

BAG = """
name: bag
robot: ir361
joint_states: {effort: torque, joints: [{joint: axis2, zero_offset: 0.5, gear_ratio: 2.0}]}
"""

TABLE = """
kind: joint_table
robot: ir361
joints: [axis1, axis2, axis3]
time_s: [0.0, 1.0]
position: [[0.0, 0.0, 0.0], [0.5, 0.2, 0.1]]
"""

MISTAKES = [
    ("robot", "position_max: 2.7", "position_max: 155.0", ("155 degrees", "2.705 rad")),
    ("robot", "velocity: 2.6", "velocity: 149.0", ("149 degrees/s", "2.601 rad/s")),
    ("robot", "a_m: 0.480", "a_m: 480.0", ("480 mm", "0.48 m")),
    ("robot", "alpha_rad: 1.5707963267948966", "alpha_rad: 90.0", ("90 degrees", "1.571 rad")),
    ("robot", "0.0, 9.81]", "0.0, 981.0]", ("981 cm/s²", "9.81 m/s²")),
    ("robot", "torque: 600.0", "torque: 600000.0", ("600000 N mm", "600 N m")),
    ("robot", "gear_ratio: 121.0", "gear_ratio: 0.00826", ("its inverse", "121.1")),
    ("robot", "l_m: 0.488", "l_m: 488", ("488 mm", "0.488 m")),
    ("robot", "name: ir361", "name: a\ntool_rpy_rad: [0.0, 90.0, 0.0]", ("90 degrees",)),
    ("cell", "error_rad: 0.1", "error_rad: 5.7", ("5.7 degrees", "0.09948 rad")),
    ("cell", "position_gain_per_s: 15.0", "position_gain_per_s: 0.01", ("0.01 1/ms", "10 1/s")),
    ("cell", "deceleration_rad_s2: 12.0", "deceleration_rad_s2: 1.0e-30", ("0.1 to",)),
    ("cell", "deceleration_rad_s2: 12.0", "deceleration_rad_s2: 0.01", ("0.1 to",)),
    ("cell", "cutoff_hz: 40.0", "cutoff_hz: 0.04", ("0.04 kHz", "40 Hz")),
    ("cell", "a_m: 0.120", "a_m: 120.0", ("120 mm", "0.12 m")),
    ("cell", "percent: [5.0,", "percent: [0.05,", ("0.05 parts of 1", "5 %")),
    (
        "cell",
        "0.0, 0.0, 0.0]\n  rotation",
        "0.0, 0.0, 250.0]\n  rotation",
        ("250 mm", "0.25 m"),
    ),
    ("motion", "speed_m_s: 0.1", "speed_m_s: 100.0", ("100 mm/s", "0.1 m/s")),
    ("motion", "near: [0.0", "near: [90.0", ("90 degrees", "1.571 rad")),
    ("map", "rate_hz: 500.0", "rate_hz: 0.5", ("0.5 kHz", "500 Hz")),
    ("map", "period_s: 10.0", "period_s: 10000.0", ("10000 ms", "10 s")),
    ("map", "per_a: 95.0", "per_a: 95000.0", ("0.001 to", "5000 N m/A")),
    ("map", "offset: 1.5", "offset: 90.0", ("90 degrees", "1.571 rad")),
    ("map", "gear_ratio: 101.0", "gear_ratio: 0.0099", ("its inverse", "101")),
    ("map", "position: 7.0", "position: 400.0", ("400 degrees", "6.981 rad")),
    ("map", "speed: 4.0", "speed: 230.0", ("230 degrees/s", "4.014 rad/s")),
    ("map", "torque: 800.0", "torque: 800000.0", ("800000 N mm", "800 N m")),
    ("bag", "offset: 0.5", "offset: 45.0", ("45 degrees", "0.7854 rad")),
    ("bag", "gear_ratio: 2.0", "gear_ratio: 0.02", ("its inverse", "50")),
    ("table", "0.5, 0.2, 0.1", "90.0, 0.2, 0.1", ("90 degrees", "1.571 rad")),
    ("table", "[0.0, 1.0]", "[0.0, 20000.0]", ("20000 ms", "20 s")),
    ("motion", "[0.9, 0.0, 1.0]", "[900.0, 0.0, 1000.0]", ("mm", "1.345 m")),
]


@pytest.mark.parametrize(("kind", "right", "wrong", "values"), MISTAKES)
def test_a_value_in_another_unit_is_refused_with_that_unit(
    kind: str, right: str, wrong: str, values: tuple[str, ...], tmp_path: Path
) -> None:
    written = {"motion": MOTION, "map": MAP, "bag": BAG, "table": TABLE}
    text = written.get(kind) or bundled(f"{kind}s")
    kind = {"bag": "map", "table": "motion"}.get(kind, kind)
    assert right in text
    load_file(tmp_path, kind, text)
    message = refusal(tmp_path, kind, text.replace(right, wrong, 1), *values)
    assert re.search(r"\.yaml:\d+:\d+: [a-z]", message)


@pytest.mark.parametrize(
    ("right", "wrong", "values"),
    [
        ("mass_kg: 5.8444", "mass_kg: 5844.4", ("5844.4 g", "5.844 kg")),
        (
            "mass_kg: 1.2 ",
            "mass_kg: 1200.0 ",
            ("links.5.radius_of_gyration_m: 0.00127475 m", "mass in g"),
        ),
        ("[0.022, 0.014, 0.020,", "[22000.0, 14000.0, 20000.0,", ("kg cm²",)),
        ("centre_m: [0.0537,", "centre_m: [53.7,", ("53.7016 mm", "0.0537 m")),
    ],
)
def test_grams_and_square_millimetres_of_a_body_are_recognised(
    right: str, wrong: str, values: tuple[str, ...], tmp_path: Path
) -> None:
    text = bundled("plants", "kr15")
    assert right in text
    (tmp_path / "cell.yaml").write_text(
        bundled("cells", "kr15").replace("plant: kr15", "plant: plant.yaml")
    )
    (tmp_path / "plant.yaml").write_text(text.replace(right, wrong, 1))
    with raises_code(ConfigError, "RID-FILE-VALUE", *values):
        load_cell(str(tmp_path / "cell.yaml"))


def test_all_problems_of_a_file_are_reported_at_once(tmp_path: Path) -> None:
    text = bundled("robots")
    for right, wrong in (("-2.7", "-155.0"), ("position_max: 1.0", "position_max: 57.0")):
        text = text.replace(right, wrong, 1)
    first, second = refusal(
        tmp_path, "robot", text.replace("a_m: 0.480", "a_m: 480.0")
    ).splitlines()[:2]
    assert all(part in first for part in ("kinematics.rows.2.a_m: 480 m", "0 to 20 m"))
    assert "joints.0.limits.position_min: -155 rad" in second


def test_a_key_declared_implausible_on_purpose_is_accepted(tmp_path: Path) -> None:
    text = bundled("robots").replace("torque: 600.0", "torque: 600000.0")
    assert "joints.1.limits.torque" in refusal(tmp_path, "robot", text)
    load_file(tmp_path, "robot", f"{text}\nimplausible_on_purpose: [joints.1.limits.torque]\n")
    assert load_robot(str(tmp_path / "robot.yaml")).joints[1].limits.torque == 600000.0


def test_the_unit_of_a_zero_offset_is_that_of_the_map(tmp_path: Path) -> None:
    in_degrees = MAP.replace("columns: 7", "columns: 7\nunits: {position: deg}")
    load_file(tmp_path, "map", in_degrees.replace("offset: 1.5", "offset: 90.0"))
    nine_thousand = in_degrees.replace("offset: 1.5", "offset: 9000.0")
    refusal(tmp_path, "map", nine_thousand, "joints.0.zero_offset:", "9000 deg", "0 to", "900 deg")
    motor = MAP.replace("columns: 7", "columns: 7\nside: motor")
    load_file(tmp_path, "map", motor.replace("offset: 1.5", "offset: 90.0"))
    meant = "implausible_on_purpose: [joints.0.zero_offset]\n"
    load_file(tmp_path, "map", MAP.replace("offset: 1.5", "offset: 90.0") + meant)


def test_a_table_file_is_checked_with_the_same_ranges(tmp_path: Path) -> None:
    (tmp_path / "path.csv").write_text("time_s,axis1,axis2,axis3\n0,0,0,0\n1,90,0,0\n")
    text = "kind: joint_table\nrobot: ir361\nfile: path.csv\n"
    with raises_code(
        ConfigError, "RID-TABLE-INVALID", "path.csv: position:", "90 degrees", "1.571 rad"
    ):
        load_file(tmp_path, "motion", text)
    load_file(tmp_path, "motion", f"{text}implausible_on_purpose: [position]\n")


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("joints.1.limits.torqe", ("'joints.1.limits.torqe'", "joints.1.limits.torque")),
        ("name", ("'name'",)),
        ("joints.1.limits.torque", ("joints.1.limits.torque", "plausible")),
    ],
)
def test_a_declaration_without_effect_is_refused(
    name: str, values: tuple[str, ...], tmp_path: Path
) -> None:
    text = bundled("robots") + f"\nimplausible_on_purpose: [{name}]\n"
    refusal(tmp_path, "robot", text, " implausible_on_purpose", *values)


def test_a_linear_axis_is_checked_in_metres(tmp_path: Path) -> None:
    text = bundled("robots").replace("- name: axis1", "- name: axis1\n    type: prismatic")
    text = text.replace("spring: {joint: axis2, l_m: 0.488, r_m: 0.100}", "")
    text = text.replace("position_max: 2.7", "position_max: 14.0")
    load_file(tmp_path, "robot", text)
    millimetres = text.replace("position_max: 14.0", "position_max: 2700.0")
    refusal(tmp_path, "robot", millimetres, "2700 mm", "2.7 m")


ARM = """
name: arm
kinematics:
  convention: modified_dh
  rows: [{{a_m: {length}, d_m: 0.0}}]
joints:
  - name: axis1
    limits:
      position_min: -{angle}
      position_max: {angle}
      velocity: {speed}
      acceleration: {rate}
      torque: {torque}
    gear_ratio: {gear}
cad: [{{mass_kg: {mass}, inertia_kg_m2: [{i}, 0.0, 0.0, {i}, 0.0, {i}]}}]
"""


@pytest.mark.parametrize(
    "size",
    [
        {"length": 0.02, "angle": 1.0, "speed": 3.0, "rate": 10.0, "torque": 0.3, "gear": 1.0}
        | {"mass": 0.02, "i": 3e-6},
        {"length": 0.29, "angle": 6.28, "speed": 3.14, "rate": 20.0, "torque": 9.0, "gear": 100.0}
        | {"mass": 0.1, "i": 5e-5},
        {"length": 1.6, "angle": 2.6, "speed": 0.8, "rate": 0.8, "torque": 9e4, "gear": 370.0}
        | {"mass": 1500.0, "i": 900.0},
        {"length": 0.1, "angle": 12.6, "speed": 45.0, "rate": 700.0, "torque": 12.0, "gear": 30.0}
        | {"mass": 1.0, "i": 1e-3},
    ],
    ids=["toy servo", "desktop arm", "payload of 1.3 t", "fast wrist"],
)
def test_small_large_and_fast_robots_are_plausible(size: dict[str, float], tmp_path: Path) -> None:
    load_file(tmp_path, "robot", ARM.format(**size))
    limits = load_robot(str(tmp_path / "robot.yaml")).joints[0].limits
    assert (limits.velocity, limits.torque) == (size["speed"], size["torque"])


WITHOUT_RANGE = {
    *("late_by_cycles_limit", "normal", "sensitivity", "axis", "coupling", "crosstalk", "turns"),
    *("zero_jump_pc", "drift_pc_s", "clock_offset_s"),
    *("load_friction", "tachometer_ripple", "friction_drift_per_s", "rise_k_per_w"),
    *("loss_at_rated_w", "friction_per_k", "torque_constant_per_k"),
    *("time_s", "position", "velocity"),  # keys of a joint table: `derived` states their ranges
    "zero_offset",  # key of an import map, in the unit of the positions: `derived` states its range
}
"""Keys that need no range: numbers without a unit, directions, matrices, simulated values."""


def numbers(model: type[BaseModel], visited: set[type[BaseModel]]) -> Iterator[tuple[str, Any]]:
    """Yield key and annotation of every floating-point number that a file may contain."""
    visited.add(model)
    for name, field in model.model_fields.items():
        parts = [*pieces(field.annotation), *field.metadata]
        for part in parts:
            if inspect.isclass(part) and issubclass(part, BaseModel) and part not in visited:
                yield from numbers(part, visited)
        if float in parts:
            yield name, parts


def pieces(annotation: Any) -> Iterator[Any]:
    """Yield an annotation and all its parts."""
    yield annotation
    for part in (*typing.get_args(annotation), *getattr(annotation, "metadata", ())):
        yield from pieces(part)


def test_every_physical_key_of_every_file_has_a_range() -> None:
    # Excluded: numbers of a timed path have other units; the robot's limits apply to its rows.
    visited: set[type[BaseModel]] = {TimedWay}
    files = (CellConfig, RobotDescription, PlantConfig, MotionFile, ImportMap)
    lacking = {
        name
        for file in files
        for name, parts in numbers(file, visited)
        if not any(isinstance(part, Plausible | Le | Lt) for part in parts)
    }
    assert lacking - WITHOUT_RANGE == set()


def test_a_command_refuses_limits_in_degrees(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["init", str(tmp_path / "cell")]) == 0
    robot = tmp_path / "cell" / "robot.yaml"
    robot.write_text(robot.read_text().replace("position_max: 2.7", "position_max: 155.0"))
    assert run(["check", str(tmp_path / "cell" / "cell.yaml")]) == 2
    message = " ".join(capsys.readouterr().err.split())
    for value in ("RID-FILE-VALUE", "155", "15", "degrees", "2.705"):
        assert value in message


OPTIONS = [
    ("identify a --loaded a --load-mass 2805", ("2805 g", "2.805 kg")),
    ("identify a --band 0.05", ("0.05 kHz", "50 Hz")),
    ("identify a --standstill 5", ("5 degrees/s", "0.08727 rad/s")),
    ("validate m.json a --mass 0.05", ("0.1 to", "100000 kg")),
    ("payload identify --loaded a --mass-limit 0.05", ("0.05 parts of 1", "5 %")),
    ("payload identify --loaded a --centre-limit 0.01", ("0.01 m", "10 mm")),
    (
        "payload identify --loaded a --torque-constant-sigma 0.01",
        ("0.01 parts of 1", "1 %"),
    ),
    ("payload identify --loaded a --known m=2805", ("2805 g", "2.805 kg")),
    ("payload identify --loaded a --known m=2.805+-5", ("5 g", "0.005 kg")),
    ("payload identify --loaded a --known cz=60", ("60 mm", "0.06 m")),
    ("payload identify --loaded a --known Ixx=9000", ("9000 kg cm²", "0.9 kg m²")),
    ("payload kr15 --until-mass 50", ("50 g", "0.05 kg")),
    ("payload kr15 --rehearsal 0.25", ("0.25 parts of 1", "25 %")),
    ("payload kr15 --known m=9579", ("9579 g", "9.579 kg")),
    ("sensitivity kr15 --share 0.05", ("0.05 parts of 1", "5 %")),
    ("sensitivity kr15 --bias 12000", ("12000 N mm", "12 N m")),
]


@pytest.mark.parametrize(("words", "values"), OPTIONS)
def test_a_number_in_another_unit_is_refused_with_its_option(
    words: str, values: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(words.split()) == 2
    error = " ".join(capsys.readouterr().err.split())
    assert re.search(r"rid-daq: --[a-z-]+\b.*: [\d.]+ .*\[RID-(OPTION|REQ)-RANGE\]", error)
    assert all(value in error for value in values), error
