"""Import: the messages of MCAP files and ROS bags become a table, and each field gets a column
name.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as BagWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from acquisition.imports.read import import_csv
from acquisition.maps.import_map import ImportMap
from acquisition.proposals.propose import propose_map
from acquisition.sources.array_tables import write_array_tables
from acquisition.sources.message_files import read_message_arrays
from config.errors import ConfigError
from config.load import to_yaml
from tests.builders.foreign_tables import ROWS, sound_table, two_joint_map, two_joint_robot
from tests.builders.raised_codes import raises_code

TABLE = sound_table()
TOPIC = "/robot_state"
NS = [1_700_000_000 * 10**9 + round(stamp * 1e9) for stamp in TABLE[:, 0].tolist()]
Save = Callable[[Path], Path]


def named_map(**changes: object) -> ImportMap:
    joints = [
        {
            "joint": name,
            "position": f"{TOPIC}.arm.q[{i}]",
            "velocity": f"{TOPIC}.arm.qd[{i}]",
            "torque": f"{TOPIC}.arm.tau[{i}]",
        }
        for i, name in enumerate("ab")
    ]
    time = {"column": f"{TOPIC}.log_time", "unit": "ns"}
    return two_joint_map(**({"columns": None, "time": time, "joints": joints} | changes))


def state(row: int) -> dict[str, Any]:
    values = TABLE[row].tolist()
    arm = {"q": values[1:3], "qd": values[3:5], "tau": values[5:7]}
    return {"arm": arm, "mode": 3, "name": "arm", "faults": [1] * (row % 2)}


def save_json(folder: Path) -> Path:
    path = folder / "log.mcap"
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start()
        schema = writer.register_schema("State", "jsonschema", b"{}")
        channel = writer.register_channel(TOPIC, "json", schema)
        camera = writer.register_channel("/camera", "json", schema)
        for row, ns in enumerate(NS):
            writer.add_message(channel, ns, json.dumps(state(row)).encode(), ns)
        writer.add_message(camera, NS[0], b"not JSON", NS[0])
        writer.finish()
    return path


def save_protobuf(folder: Path) -> Path:
    file = descriptor_pb2.FileDescriptorProto(name="state.proto", package="log", syntax="proto3")
    arm, robot = file.message_type.add(name="Arm"), file.message_type.add(name="State")
    kinds = descriptor_pb2.FieldDescriptorProto
    for number, name in enumerate(("q", "qd", "tau"), 1):
        arm.field.add(name=name, number=number, type=kinds.TYPE_DOUBLE, label=kinds.LABEL_REPEATED)
    robot.field.add(name="arm", number=1, type=kinds.TYPE_MESSAGE, type_name=".log.Arm",
                    label=kinds.LABEL_OPTIONAL)  # fmt: skip
    robot.field.add(name="mode", number=2, type=kinds.TYPE_INT32, label=kinds.LABEL_OPTIONAL)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    message_class = message_factory.GetMessageClass(pool.FindMessageTypeByName("log.State"))
    path = folder / "log.mcap"
    with path.open("wb") as stream:
        writer = McapWriter(stream)
        writer.start()
        data = descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString()
        schema = writer.register_schema("log.State", "protobuf", data)
        channel = writer.register_channel(TOPIC, "protobuf", schema)
        for row, ns in enumerate(NS):
            message = message_class(arm=state(row)["arm"], mode=0)
            writer.add_message(channel, ns, message.SerializeToString(), ns)
        writer.finish()
    return path


def save_ros(folder: Path, storage: StoragePlugin) -> Path:
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg("float64[] q\nfloat64[] qd\nfloat64[] tau", "my/msg/Arm"))
    store.register(get_types_from_msg("my/Arm arm\nint32 mode\nstring name", "my/msg/State"))
    arm_type, state_type = store.types["my/msg/Arm"], store.types["my/msg/State"]
    path = folder / "bag"
    with BagWriter(path, version=9, storage_plugin=storage) as writer:
        connection = writer.add_connection(TOPIC, "my/msg/State", typestore=store)
        for row, ns in enumerate(NS):
            arm = {name: np.array(value) for name, value in state(row)["arm"].items()}
            message = state_type(arm=arm_type(**arm), mode=0, name="arm")
            raw = store.serialize_cdr(message, "my/msg/State")
            writer.write(connection, ns, raw)
    return path


def save_ros_sqlite(folder: Path) -> Path:
    return save_ros(folder, StoragePlugin.SQLITE3)


def save_ros_mcap(folder: Path) -> Path:
    return next(save_ros(folder, StoragePlugin.MCAP).glob("*.mcap"))


@pytest.mark.parametrize("save", [save_json, save_protobuf, save_ros_sqlite, save_ros_mcap])
def test_all_kinds_of_messages_give_the_same_recording(save: Save, tmp_path: Path) -> None:
    path = save(tmp_path)
    (table,), layout = write_array_tables((path,), named_map(), tmp_path)
    recording, report = import_csv(table, named_map(), layout=layout)
    np.testing.assert_array_equal(recording.position, TABLE[:, 1:3])
    np.testing.assert_array_equal(recording.torque_nm, TABLE[:, 5:7])
    np.testing.assert_allclose(np.diff(recording.time_s), np.diff(TABLE[:, 0]), atol=2e-9)
    assert report.rows_used == ROWS


def test_fields_are_named_by_their_path(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    joints = [{"q": 0.5, "tau": 1}, {"q": 1.5, "tau": 2}]
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start()
        channel = writer.register_channel("/state", "json", 0)
        for ns in (10, 20, 30):
            data = {"joints": joints, "on": True, "text": "x", "none": None, "n": [[1, 2], [3, 4]]}
            writer.add_message(channel, ns, json.dumps(data).encode(), ns)
        writer.finish()
    arrays = read_message_arrays(path)
    assert arrays["/state.joints[1].q"].tolist() == [1.5] * 3
    assert arrays["/state.joints[0].tau"].tolist() == [1] * 3
    assert arrays["/state.on"].tolist() == [True] * 3
    assert arrays["/state.log_time"].tolist() == [10, 20, 30]
    assert set(arrays) == {
        *(f"/state.joints[{i}].{name}" for i in (0, 1) for name in ("q", "tau")),
        "/state.on",
        "/state.log_time",
    }


def test_a_value_that_is_null_in_some_messages_is_missing(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start()
        channel = writer.register_channel("/state", "json", 0)
        for q, tau in ((0.5, [1.0, 2.0]), (None, [None, 2.0]), (1.5, None)):
            data = json.dumps({"joint": {"q": q}, "tau": tau}).encode()
            writer.add_message(channel, 10, data, 10)
        writer.finish()
    arrays = read_message_arrays(path)
    np.testing.assert_equal(arrays["/state.joint.q"], [0.5, np.nan, 1.5])
    np.testing.assert_equal(arrays["/state.tau"], [[1, 2], [np.nan, 2], [np.nan, np.nan]])


def test_a_field_of_varying_length_is_left_out(tmp_path: Path) -> None:
    arrays = read_message_arrays(save_json(tmp_path), [f"{TOPIC}.arm.q[0]"])
    assert f"{TOPIC}.faults" not in arrays
    assert arrays[f"{TOPIC}.arm.q"].shape == (ROWS, 2)


def test_a_map_is_proposed_for_messages(tmp_path: Path) -> None:
    path = save_ros_sqlite(tmp_path)
    (tmp_path / "robot.yaml").write_text(to_yaml(two_joint_robot()))
    proposal = propose_map(path, str(tmp_path / "robot.yaml"))
    assert proposal.report is not None
    assert proposal.keys["time"] == {"column": f"{TOPIC}.log_time", "unit": "ns"}
    assert proposal.keys["joints"][1]["torque"] == f"{TOPIC}.arm.tau[1]"


@pytest.mark.parametrize(
    ("names", "detail"), [(["b", "a", "hand"], None), (["j1", "j2"], "j1, j2")]
)
def test_joint_states_are_proposed_as_such(
    names: list[str], detail: str | None, tmp_path: Path
) -> None:
    store = get_typestore(Stores.ROS2_HUMBLE)
    types, kind = store.types, "sensor_msgs/msg/JointState"
    stamp = types["builtin_interfaces/msg/Time"](1, 0)
    numbers = np.zeros(len(names))
    message = types[kind](types["std_msgs/msg/Header"](stamp, ""), names, numbers, numbers, numbers)
    path = tmp_path / "bag"
    with BagWriter(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/joint_states", kind, typestore=store)
        writer.write(connection, 1, store.serialize_cdr(message, kind))
    (tmp_path / "robot.yaml").write_text(to_yaml(two_joint_robot()))
    for bag in (path, next(path.glob("*.mcap"))):
        proposal = propose_map(bag, str(tmp_path / "robot.yaml"))
        assert proposal.keys["joint_states"]["effort"] == "?"
        assert ("names" in proposal.keys["joint_states"]) == (detail is not None)
        assert detail is None or detail in proposal.doubts[0]


def test_a_damaged_file_is_refused(tmp_path: Path) -> None:
    path = save_json(tmp_path)
    with raises_code(ConfigError, "RID-FILE-TYPE", "log.mcap"):
        read_message_arrays(path)  # all topics: /camera is not JSON
    path.write_bytes(path.read_bytes()[:5000])
    with raises_code(ConfigError, "RID-FILE-TYPE", "log.mcap"):
        read_message_arrays(path, [f"{TOPIC}.arm.q"])


@pytest.mark.parametrize("content", [b"", b"\x00\x01" * 500, None])
def test_no_map_is_proposed_for_a_damaged_or_missing_file(
    content: bytes | None, tmp_path: Path
) -> None:
    path = tmp_path / "log.mcap"
    if content is not None:
        path.write_bytes(content)
    code = "RID-FILE-READ" if content is None else "RID-FILE-TYPE"
    with raises_code(ConfigError, code, "log.mcap"):
        propose_map(path, "ir361")


def test_a_missing_field_is_refused_with_those_that_exist(tmp_path: Path) -> None:
    path = save_json(tmp_path)
    time = {"column": f"{TOPIC}.stamp"}
    with raises_code(ConfigError, "RID-IMPORT-HEADER", f"{TOPIC}.stamp", f"{TOPIC}.mode"):
        write_array_tables((path,), named_map(time=time), tmp_path)


def test_protocol_buffers_without_their_library_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = save_protobuf(tmp_path)
    monkeypatch.setitem(sys.modules, "google.protobuf", None)
    with raises_code(ConfigError, "RID-INSTALL-LIBRARY", str(path)):
        read_message_arrays(path)
