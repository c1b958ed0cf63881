"""Import of ROS bags: joint states become a table that keeps every digit."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from acquisition.imports.read import import_csv
from acquisition.imports.report import ImportReport
from acquisition.maps.import_map import ImportMap
from acquisition.sources.bags import convert_bag_to_table, with_message_names
from config.errors import ConfigError, DataQualityError
from tests.builders.raised_codes import raises_code, raises_invalid

TYPES = get_typestore(Stores.ROS2_JAZZY)
NAMES = ("shoulder", "elbow")
T = 0.01 * np.arange(300)
POSITION = np.stack([np.sin(3.0 * T), 0.5 * np.cos(2.0 * T)], axis=1)
VELOCITY = np.stack([3.0 * np.cos(3.0 * T), -np.sin(2.0 * T)], axis=1)
EFFORT = np.stack([np.cos(5.0 * T), np.sin(5.0 * T)], axis=1)


def write_bag(
    folder: Path,
    storage: StoragePlugin = StoragePlugin.MCAP,
    *,
    topic: str = "/joint_states",
    names: Sequence[str] = NAMES,
    columns: Sequence[int] = (0, 1),
    stamped: bool = True,
    effort: bool = True,
    lacking: Mapping[str, int] = {},
    split: bool = False,
) -> Path:
    """Write a bag with an arm, and a gripper on the same topic.

    A quantity in `lacking` is NaN for the joint with that index. With `split` there is no gripper;
    each joint has its own messages, and those of joint 2 come 2 ms later.
    """
    kinds = TYPES.types
    header, time = kinds["std_msgs/msg/Header"], kinds["builtin_interfaces/msg/Time"]
    state, kind = kinds["sensor_msgs/msg/JointState"], "sensor_msgs/msg/JointState"
    with Writer(folder, version=9, storage_plugin=storage) as writer:
        connection = writer.add_connection(topic, kind, typestore=TYPES)
        for row, stamp in enumerate(T):
            ns = 1_700_000_000 * 10**9 + round(stamp * 1e9)
            when = time(sec=ns // 10**9, nanosec=ns % 10**9) if stamped else time(sec=0, nanosec=0)
            arm = {
                "position": POSITION[row, list(columns)],
                "velocity": VELOCITY[row, list(columns)],
            }
            arm["effort"] = EFFORT[row, list(columns)] if effort else np.empty(0)
            for quantity, joint in lacking.items():
                arm[quantity][joint] = np.nan
            if split:
                for j in range(len(names)):
                    head = header(stamp=time(sec=ns // 10**9, nanosec=ns % 10**9), frame_id="")
                    quantities = {quantity: values[[j]] for quantity, values in arm.items()}
                    message = state(header=head, name=[names[j]], **quantities)
                    writer.write(connection, ns, TYPES.serialize_cdr(message, kind))
                    ns += 2_000_000
                continue
            hand = dict.fromkeys(arm, np.array([0.04]))
            for who, values in ((names, arm), (["finger"], hand)):
                head = header(stamp=when, frame_id="")
                message = state(header=head, name=list(who), **values)
                writer.write(connection, ns, TYPES.serialize_cdr(message, kind))
    return folder


def bag_map(**states: Any) -> ImportMap:
    values = {"name": "m", "robot": "r", "joint_states": {"effort": "torque"} | states}
    return ImportMap.model_validate_json(json.dumps(values))


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize("whole_folder", [True, False])
def test_a_bag_becomes_a_table_and_the_map_that_reads_it(
    tmp_path: Path, storage: StoragePlugin, whole_folder: bool
) -> None:
    bag = write_bag(tmp_path / "bag", storage)
    path = bag if whole_folder else next(p for p in bag.iterdir() if p.suffix != ".yaml")
    table = tmp_path / "table.csv"
    import_map = convert_bag_to_table(path, bag_map(), NAMES, table)
    recording, report = import_csv(table, import_map)
    np.testing.assert_array_equal(recording.position, POSITION)
    np.testing.assert_array_equal(recording.torque_nm, EFFORT)
    np.testing.assert_allclose(recording.time_s, T, atol=1e-9)
    assert report.velocity_ratio == pytest.approx((1.0, 1.0), abs=1e-3)
    assert report.rows_read == len(T)  # messages of the gripper are ignored


def test_joints_are_in_the_robots_order_for_any_order_in_the_messages(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "bag")
    table = tmp_path / "table.csv"
    states = bag_map(names=("elbow", "shoulder"), effort="current")
    import_map = convert_bag_to_table(bag, states, ("a", "b"), table)
    assert import_map.joint_names == ("a", "b")
    assert import_map.joints[0].current == 5
    read = np.loadtxt(table, delimiter=",")
    np.testing.assert_array_equal(read[:, 1:3], POSITION[:, ::-1])


def test_each_joint_uses_its_own_sign_zero_gear_and_constant(tmp_path: Path) -> None:
    """The conversion is that of a CSV file: position = sign * (raw - zero) / gear, torque = sign *
    raw * constant * gear.
    """
    elbow = {"joint": "elbow", "position_sign": -1, "torque_sign": -1, "zero_offset": 0.25}
    elbow |= {"gear_ratio": 2.0, "torque_constant_nm_per_a": 3.0}
    shoulder = {"joint": "shoulder", "torque_constant_nm_per_a": 1.0}
    table = tmp_path / "table.csv"
    states = bag_map(effort="current", joints=[elbow, shoulder])
    import_map = convert_bag_to_table(write_bag(tmp_path / "bag"), states, NAMES, table)
    recording, report = import_csv(table, import_map)
    np.testing.assert_array_equal(recording.position[:, 0], POSITION[:, 0])
    np.testing.assert_allclose(recording.position[:, 1], -(POSITION[:, 1] - 0.25) / 2.0)
    np.testing.assert_allclose(recording.torque_nm, EFFORT * [1.0, -6.0])
    assert report.velocity_ratio == pytest.approx((1.0, 1.0), abs=1e-3)


def test_keys_implausible_on_purpose_stay_declared_in_the_tables_map(tmp_path: Path) -> None:
    joints = [{"joint": "elbow", "zero_offset": 40.0}]
    meant = ("plausible.speed", "joint_states.joints.0.zero_offset")
    states = bag_map(joints=joints).model_copy(update={"implausible_on_purpose": meant})
    import_map = convert_bag_to_table(
        write_bag(tmp_path / "bag"), states, NAMES, tmp_path / "table.csv"
    )
    assert import_map.implausible_on_purpose == ("plausible.speed", "joints.1.zero_offset")


def test_without_stamps_the_recording_time_is_used(tmp_path: Path) -> None:
    table = tmp_path / "table.csv"
    convert_bag_to_table(write_bag(tmp_path / "bag", stamped=False), bag_map(), NAMES, table)
    np.testing.assert_allclose(np.loadtxt(table, delimiter=",")[:, 0], T, atol=1e-9)


@pytest.mark.parametrize(
    ("states", "joints", "names"),
    [
        ({"topic": "/arm"}, NAMES, ("topic /arm", "/joint_states")),
        ({}, ("joint1", "joint2"), ("(joint1, joint2)", "joint_states.names")),
    ],
)
def test_a_topic_or_joint_that_the_bag_lacks_is_refused_with_its_key(
    tmp_path: Path, states: dict[str, Any], joints: tuple[str, ...], names: tuple[str, ...]
) -> None:
    bag = write_bag(tmp_path / "bag")
    with raises_code(ConfigError, "RID-BAG-TOPIC", f"{bag}: ", *names):
        convert_bag_to_table(bag, bag_map(**states), joints, tmp_path / "table.csv")


def test_a_bag_without_efforts_is_refused(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "bag", effort=False)
    with raises_code(DataQualityError, "RID-BAG-TOPIC"):
        convert_bag_to_table(bag, bag_map(), NAMES, tmp_path / "table.csv")


@pytest.mark.parametrize("name", ["bag.mcap", "bag.db3", "bag.bag", "folder", "bag.csv"])
@pytest.mark.parametrize("content", [b"", b"\x89MCAP0\r\n" + b"\x00" * 50, b"SQLite format 3\x00x"])
def test_a_file_that_is_not_a_bag_is_refused(tmp_path: Path, name: str, content: bytes) -> None:
    path = tmp_path / name
    if name == "folder":
        path.mkdir()
    else:
        path.write_bytes(content)
    with raises_code(ConfigError, "RID-FILE-TYPE", f"{path}: "):
        convert_bag_to_table(path, bag_map(), NAMES, tmp_path / "table.csv")


def test_a_truncated_bag_is_refused(tmp_path: Path) -> None:
    (whole,) = write_bag(tmp_path / "bag").glob("*.mcap")
    data = whole.read_bytes()
    for length in range(1, len(data), len(data) // 12):
        path = tmp_path / "cut.mcap"
        path.write_bytes(data[:length])
        with pytest.raises(ConfigError):
            convert_bag_to_table(path, bag_map(), NAMES, tmp_path / "table.csv")


@pytest.mark.parametrize("names", [("elbow", "elbow"), ("elbow", "shoulder", "elbow")])
def test_a_joint_named_twice_in_a_message_is_refused(
    tmp_path: Path, names: tuple[str, ...]
) -> None:
    columns = [NAMES.index(name) for name in names]
    bag = write_bag(tmp_path / "bag", names=names, columns=columns)
    with raises_code(ConfigError, "RID-BAG-JOINT-TWICE") as refused:
        convert_bag_to_table(bag, bag_map(), NAMES, tmp_path / "table.csv")
    assert refused.value.refusal == "RID-BAG-JOINT-TWICE"
    assert str(refused.value).startswith(str(bag))


def test_a_joint_of_another_device_named_twice_is_ignored(tmp_path: Path) -> None:
    names, columns = (*NAMES, "finger", "finger"), [0, 1, 0, 0]
    bag = write_bag(tmp_path / "bag", names=names, columns=columns)
    table = tmp_path / "table.csv"
    recording, _ = import_csv(table, convert_bag_to_table(bag, bag_map(), NAMES, table))
    np.testing.assert_array_equal(recording.torque_nm, EFFORT)


def test_two_joints_of_a_map_with_one_name_are_refused() -> None:
    with raises_invalid("joint_states", "two joints"):
        bag_map(names=("elbow", "elbow"))


def test_a_joint_without_velocity_is_read_and_reported(tmp_path: Path) -> None:
    table = tmp_path / "table.csv"
    bag = write_bag(tmp_path / "bag", lacking={"velocity": 1})
    recording, report = import_csv(table, convert_bag_to_table(bag, bag_map(), NAMES, table))
    np.testing.assert_array_equal(recording.position, POSITION)
    assert report.velocity_ratio[1] is None
    assert [re.findall(r"\w+(?= \(100 %)", found) for found in report.findings] == [["elbow"]]


@pytest.mark.parametrize("quantity", ["position", "effort"])
def test_a_joint_that_no_message_contains_is_refused_with_its_name(
    tmp_path: Path, quantity: str
) -> None:
    bag = write_bag(tmp_path / "bag", lacking={quantity: 1})
    with raises_code(DataQualityError, "RID-BAG-TOPIC", f"{bag}: ", quantity, "elbow"):
        convert_bag_to_table(bag, bag_map(), NAMES, tmp_path / "table.csv")


def test_joints_in_separate_messages_are_merged(tmp_path: Path) -> None:
    table = tmp_path / "table.csv"
    bag = write_bag(tmp_path / "bag", split=True)
    recording, report = import_csv(table, convert_bag_to_table(bag, bag_map(), NAMES, table))
    np.testing.assert_array_equal(recording.position[:, 0], POSITION[:, 0])
    elbow = 0.5 * np.cos(2.0 * (T - 0.002))
    np.testing.assert_allclose(recording.position[1:, 1], elbow[1:], atol=5e-5)
    assert (report.rows_read, report.rows_damaged) == (300, 0)
    assert [re.findall(r"\d+", found) for found in report.findings] == [["300", "300", "300"]]


def import_named(bag: Path, table: Path) -> ImportReport:
    """Import a bag as the command does: messages of the import name the fields of the bag."""
    layout = convert_bag_to_table(bag, bag_map(), NAMES, table)
    return import_csv(table, with_message_names(layout, bag_map()), layout=layout)[1]


def test_findings_name_the_fields_of_the_messages_and_no_column(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(globals(), "EFFORT", np.zeros_like(EFFORT))
    report = import_named(write_bag(tmp_path / "bag"), tmp_path / "bag.table")
    assert [re.findall(r"effort\[\w+\]", found) for found in report.findings] == [
        [f"effort[{name}]"] for name in NAMES
    ]


def test_coarse_stamps_of_messages_are_not_explained_by_keys_of_a_map(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(globals(), "T", np.floor(10.0 * T))
    bag = write_bag(tmp_path / "bag")
    with raises_code(DataQualityError, "RID-IMPORT-ROWS", "headers"):
        import_named(bag, tmp_path / "bag.table")


def test_values_that_do_not_fit_the_names_are_counted(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "bag", names=(*NAMES, "tool"))
    with raises_code(DataQualityError, "RID-BAG-TOPIC", "3 joint", "2 of"):
        convert_bag_to_table(bag, bag_map(), NAMES, tmp_path / "table.csv")
