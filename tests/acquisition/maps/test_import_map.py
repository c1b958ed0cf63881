"""Import maps: contradictory columns, units or constants are refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from acquisition.maps.import_map import ImportMap, load_import_map
from config.errors import ConfigError
from config.load import bundled_names, load_cell, load_robot
from tests.builders.raised_codes import raises_code, raises_invalid

JOINT = {"joint": "a", "position": 1, "torque": 2}


def read(**changes: Any) -> ImportMap:
    base = {"name": "m", "robot": "r", "columns": 4, "time": {"column": 0}, "joints": [JOINT]}
    return ImportMap.model_validate_json(json.dumps(base | changes))


def test_a_minimal_map_is_enough() -> None:
    import_map = read()
    assert import_map.joint_names == ("a",)
    assert import_map.delimiter == ","
    assert import_map.period_s is None


@pytest.mark.parametrize(
    ("change", "key", "details"),
    [
        ({"joints": [JOINT | {"torque": None}]}, "joints.0", ("torque column", "current column")),
        ({"joints": [JOINT | {"current": 3}]}, "joints.0", ("torque column", "current column")),
        (
            {"joints": [JOINT | {"torque_constant_nm_per_a": 1.0}]},
            "joints.0",
            ("torque_constant_nm_per_a", "current"),
        ),
        (
            {"joints": [JOINT | {"torque": 1}]},
            "",
            ("column 1", "position of a", "torque of a"),
        ),
        (
            {"joints": [JOINT | {"position": 1.5}]},
            "joints.0.position",
            ("0 to 9999", "name"),
        ),
        (
            {"joints": [JOINT | {"position": "  "}]},
            "joints.0.position",
            ("'  '",),
        ),
        ({"joints": [JOINT | {"position": 4}]}, "", ("position of a", "column 4", "0 to 3")),
        ({"joints": [JOINT | {"gear_ratio": 0.0}]}, "joints.0", ("gear_ratio", " 0")),
        (
            {"joints": [JOINT | {"gear_ratio": -50.0, "position_sign": -1}]},
            "joints.0",
            ("gear_ratio", "position_sign"),
        ),
        ({"joints": [JOINT, JOINT]}, "", ("two joints",)),
        ({"joints": [JOINT] * 33}, "joints", ("32", "33")),
        ({"rows": {"first": 9, "last": 9}}, "rows", ("last 9", "first 9")),
        (
            {"joints": [JOINT | {"temperature": 2}]},
            "",
            ("column 2", "torque of a", "temperature of a"),
        ),
        ({"side": "load"}, "side", ("'link'", "'motor'")),
        ({"rate_hz": 100.0}, "", ("time (", "rate_hz (")),
        ({"time": None}, "", ("time (", "rate_hz (")),
        ({"joints": []}, "", ("joints", "joint_states")),
        (
            {"further_files": [{"columns": 2, "time": {"column": 2}}]},
            "",
            ("time of file 2", "column 2", "0 to 1"),
        ),
        (
            {"joint_states": {"effort": "torque"}},
            "",
            ("joint_states", "columns, joints, time"),
        ),
        (
            {"joint_states": {"effort": "torque", "joints": [{"joint": "a"}, {"joint": "a"}]}},
            "joint_states",
            ("two joints",),
        ),
        (
            {
                "joint_states": {
                    "effort": "torque",
                    "joints": [{"joint": "a", "torque_constant_nm_per_a": 2.0}],
                }
            },
            "joint_states",
            ("torque_constant_nm_per_a of a", "effort: current"),
        ),
        (
            {"units": {"position": "grad"}},
            "units.position",
            ("'rad', 'deg', 'rev', 'm', 'mm' or 'increments'",),
        ),
        (
            {"units": {"position": "increments"}},
            "",
            ("unit increments", "increments_per_rev of a"),
        ),
        ({"units": {"torque": "permille"}}, "", ("unit permille", "rated_torque_nm of a")),
        (
            {"units": {"current": "percent"}, "joints": [JOINT | {"rated_current_a": 3.0}]},
            "",
            ("rated_current_a of a", "not used"),
        ),
        ({"joints": [JOINT | {"rated_torque_nm": 3.0}]}, "", ("rated_torque_nm of a", "not used")),
    ],
)
def test_contradictions_are_refused(
    change: dict[str, Any], key: str, details: tuple[str, ...]
) -> None:
    with raises_invalid(key, *details):
        read(**change)


@pytest.mark.parametrize("name", bundled_names("maps"))
def test_bundled_maps_match_their_robots(name: str) -> None:
    import_map, robot = load_import_map(name)
    assert import_map.name == name
    assert all(joint.limits.velocity < import_map.plausible.speed for joint in robot.joints)
    for column, joint in zip(import_map.joints, robot.joints, strict=False):
        assert column.torque_constant_nm_per_a == joint.torque_constant_nm_per_a


def test_both_layouts_and_bags_have_bundled_maps() -> None:
    assert {"ur10_ros", "ur10e_19", "ur10e_31"} <= set(bundled_names("maps"))


def test_temperatures_are_given_for_every_joint_or_for_none() -> None:
    joints = [{"joint": "a", "position": 1, "torque": 2, "temperature": 3}]
    assert read(joints=joints).joints[0].temperature == 3
    joints.append({"joint": "b", "position": 4, "torque": 5})
    with raises_invalid("", "temperature"):
        read(joints=joints, columns=6)


def test_a_map_finds_its_robot_in_its_folder_and_their_joints_must_match(
    tmp_path: Path,
) -> None:
    (tmp_path / "robot.yaml").write_bytes(load_cell("ir361").files["robot.yaml"])
    joints = "".join(f"  - {{joint: axis{n}, position: {n}, torque: {n + 3}}}\n" for n in (1, 2, 3))
    text = (
        f"name: m\nrobot: robot.yaml\ncolumns: 7\ntime: {{column: 0, unit: s}}\njoints:\n{joints}"
    )
    path = tmp_path / "map.yaml"
    path.write_text(text + "plausible: {position: 7.0, speed: 4.0, torque: 800.0}\n")
    import_map, robot = load_import_map(str(path))
    assert robot == load_robot("ir361")
    assert import_map.joint_names == robot.joint_names
    path.write_text(path.read_text().replace("axis3", "axis4"))
    with raises_code(ConfigError, "RID-IMPORT-JOINTS", "map.yaml:5:1", "axis4"):
        load_import_map(str(path))


def test_a_bag_joint_that_the_robot_lacks_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "map.yaml"
    text = "name: m\nrobot: ir361\njoint_states:\n  effort: torque\n  joints:\n"
    path.write_text(f"{text}    - {{joint: elbow, position_sign: -1}}\n")
    where = "map.yaml:6:8: "
    with raises_code(ConfigError, "RID-IMPORT-JOINTS", where, "robot ir361", "'elbow'"):
        load_import_map(str(path))


def test_velocity_commands_are_given_for_every_joint_or_for_none() -> None:
    with raises_invalid("", "velocity_command"):
        read(
            columns=9,
            joints=[
                JOINT | {"velocity_command": 3},
                {"joint": "b", "position": 4, "torque": 5},
            ],
        )


def test_a_timing_of_commands_needs_commands() -> None:
    with raises_invalid("", "velocity_command"):
        read(command_timing={"interpolation": "step"})
