"""`convert_bag_to_table`: converts JointState messages of a ROS bag to a CSV file and its map.

ROS bags and MCAP files can be read. The CSV file contains the messages of one topic, with all
digits of each number, in the bag's own units and signs; the map of the table defines their meaning.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.maps.import_joint import ImportJoint, JointReading
from acquisition.maps.import_map import ImportMap
from acquisition.maps.time_column import TimeColumn
from config.arrays import FloatArray
from config.errors import ConfigError, DataQualityError, RidDaqError, system_errors

JOINT_STATE = "sensor_msgs/msg/JointState"
BAG_ENDINGS = (".db3", ".mcap", ".bag")
_QUANTITIES = ("position", "velocity", "effort")
_KEPT = (
    *("name", "robot", "units", "side", "torques", "torque_filter"),
    *("plausible", "left_out_limit", "rows", "period_s"),
)


def is_bag(path: Path) -> bool:
    """Return True for a bag: a file with a bag's ending, or a folder with `metadata.yaml`."""
    return path.suffix in BAG_ENDINGS or (path / "metadata.yaml").is_file()


def joint_state_topics(path: Path) -> dict[str, tuple[str, ...]]:
    """Return the topics with joint states in a bag, and the joints in the first message of each.

    Raises:
        ConfigError: The bag cannot be read.
    """
    found: dict[str, tuple[str, ...]] = {}
    try:
        for topic, _, message in ros_messages(path, lambda _topic, kind: kind == JOINT_STATE):
            found.setdefault(topic, tuple(message.name))
    except (RidDaqError, MemoryError):
        raise
    except Exception as error:  # for a damaged file, the library raises exceptions of many types
        raise _not_a_bag(path, error) from error
    return found


def ros_messages(
    path: Path, is_wanted: Callable[[str, str], bool]
) -> Iterator[tuple[str, int, Any]]:
    """Yield topic, recording time [ns] and message, for the wanted topics and types of message."""
    from rosbags.highlevel import AnyReader  # slow to import
    from rosbags.typesys import Stores, get_typestore

    with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
        wanted = [each for each in reader.connections if is_wanted(each.topic, each.msgtype)]
        deserialize: Callable[..., Any] = reader.deserialize
        for connection, received_ns, raw in reader.messages(connections=wanted) if wanted else ():
            yield connection.topic, received_ns, deserialize(raw, connection.msgtype)


def convert_bag_to_table(
    path: Path, import_map: ImportMap, joint_names: tuple[str, ...], table: Path
) -> ImportMap:
    """Write the messages of a bag as a CSV file, one message per row.

    The columns are the time since the first message, and the joints' positions, velocities (if
    recorded) and efforts.
    - The time is the stamp in the message's header. If these stamps are constant, it is the time at
      which the bag recorded the message.
    - Messages without any of the joints belong to another device and are ignored.
    - Values that a message does not contain are empty cells.
    - If more messages lack values of some joints than `left_out_limit` permits, the returned map
      requests interpolation to the times of the messages with the first joint.

    Args:
        path: Folder of a bag, or a file `.db3`, `.mcap` or `.bag`.
        import_map: A map with `joint_states`.
        joint_names: Joints of the robot, base to flange.
        table: CSV file to write.

    Returns:
        Import map of the CSV file.

    Raises:
        ConfigError: The bag cannot be read, the topic of joint states is missing or ambiguous, a
            message names a joint twice, or no message names a joint of the robot.
        DataQualityError: The messages contain no efforts, or lack a joint.
    """
    states = import_map.joint_states
    assert states is not None
    if not is_bag(path):
        known = ", ".join(BAG_ENDINGS)
        raise ConfigError(
            f"{path}: is not a bag (a folder with metadata.yaml, or a file {known}), but map"
            f" {import_map.name!r} has joint_states: name a bag or another map",
            code="RID-FILE-TYPE",
        )
    if not path.exists():
        raise ConfigError(f"cannot read {path}: the file does not exist", code="RID-FILE-UNKNOWN")
    n, names = len(joint_names), states.names or joint_names
    stamps, received, numbers = array("q"), array("q"), array("d")
    odd = ""
    try:
        for received_ns, message in _read_messages(path, states.topic):
            row = _joint_values(message, names)
            if row is not None:
                received.append(received_ns)
                stamps.append(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)
                numbers.extend(row)
                odd = odd or _odd_lengths(message)
    except ConfigError as error:
        place = "" if str(error).startswith(str(path)) else f"{path}: "
        raise ConfigError(f"{place}{error}", code=error.refusal) from None
    except (RidDaqError, MemoryError):
        raise
    except Exception as error:  # a damaged file can raise any type of exception
        raise _not_a_bag(path, error) from error
    if not stamps:
        raise ConfigError(
            f"{path}: no message names a joint of the robot ({', '.join(names)}): give the joint"
            " names of the messages in joint_states.names of the map",
            code="RID-BAG-TOPIC",
        )
    values = np.frombuffer(numbers, dtype=np.float64).reshape(-1, 3, n)
    is_recorded = np.array([bool(np.isfinite(values[:, i]).any()) for i in range(len(_QUANTITIES))])
    if not is_recorded[2]:
        raise DataQualityError(
            f"{path}: the messages contain no efforts{odd}: record a topic whose efforts are"
            " torques or currents",
            code="RID-BAG-TOPIC",
        )
    for number, name in enumerate(names):
        for quantity in (0, 2):
            if not np.isfinite(values[:, quantity, number]).any():
                raise DataQualityError(
                    f"{path}: no message has the {_QUANTITIES[quantity]} of joint {name}{odd}:"
                    " correct joint_states.names, or record a topic that contains it",
                    code="RID-BAG-TOPIC",
                )
    complete = np.isfinite(values[:, (0, 2)]).all(axis=(1, 2))
    is_split = 1.0 - complete.mean() > import_map.left_out_limit
    moving = np.ptp(np.frombuffer(stamps, dtype=np.int64)) > 0
    times = np.frombuffer(stamps if moving else received, dtype=np.int64)
    _write_csv(table, (times - times[0]) * 1e-9, values[:, is_recorded].reshape(len(times), -1))
    efforts, is_torque = 1 + (1 + int(is_recorded[1])) * n, states.effort == "torque"
    reading_of = {joint.joint: joint for joint in states.joints}
    joints = tuple(
        ImportJoint(
            **reading_of.get(name, JointReading(joint=name)).model_dump(),
            position=1 + i,
            velocity=1 + n + i if is_recorded[1] else None,
            torque=efforts + i if is_torque else None,
            current=None if is_torque else efforts + i,
        )
        for i, name in enumerate(joint_names)
    )
    places = {
        f"joint_states.joints.{number}.": f"joints.{joint_names.index(joint.joint)}."
        for number, joint in enumerate(states.joints)
    }
    return ImportMap(
        **{key: getattr(import_map, key) for key in _KEPT},
        implausible_on_purpose=tuple(
            _translate_key(name, places) for name in import_map.implausible_on_purpose
        ),
        columns=1 + int(is_recorded.sum()) * n,
        empty_cells="interpolate" if is_split else "damaged",
        time=TimeColumn(column=0),
        joints=joints,
    )


def with_message_names(table_map: ImportMap, bag_map: ImportMap) -> ImportMap:
    """Return the map of a bag's table with names of the messages' fields instead of columns.

    Messages of the import show these names; the user has no table.

    Args:
        table_map: Map of the table.
        bag_map: Map of the bag.
    """
    fields = {
        "position": "position",
        "velocity": "velocity",
        "torque": "effort",
        "current": "effort",
    }
    joints = tuple(
        joint.model_copy(
            update={
                key: f"{field}[{joint.joint}]"
                for key, field in fields.items()
                if getattr(joint, key) is not None
            }
        )
        for joint in table_map.joints
    )
    named = {"joints": joints, "joint_states": bag_map.joint_states}
    return table_map.model_copy(update=named)


def _not_a_bag(path: Path, error: Exception) -> ConfigError:
    return ConfigError(
        f"{path}: cannot be read as a bag: {type(error).__name__}: {error}",
        code="RID-FILE-TYPE",
    )


def _translate_key(key: str, places: Mapping[str, str]) -> str:
    """Return a key of `joint_states` as a key of the table's map."""
    old = next((old for old in places if key.startswith(old)), "")
    return places.get(old, "") + key.removeprefix(old)


def _read_messages(path: Path, topic: str | None) -> Iterator[tuple[int, Any]]:
    """Yield recording time [ns] and message for each message of one topic."""
    from rosbags.highlevel import AnyReader  # slow to import
    from rosbags.typesys import Stores, get_typestore

    with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
        found = [each for each in reader.connections if each.msgtype == JOINT_STATE]
        topics = sorted({each.topic for each in found})
        if topic is None and len(topics) != 1:
            what = "several topics" if topics else "no topic"
            listed = topics or sorted({each.topic for each in reader.connections})
            raise ConfigError(
                f"{path}: has {what} with {JOINT_STATE}; topics found:"
                f" {', '.join(listed) or 'none'}. Name one topic in the map: joint_states.topic",
                code="RID-BAG-TOPIC",
            )
        wanted = [each for each in found if topic in (None, each.topic)]
        if not wanted:
            raise ConfigError(
                f"{path}: topic {topic} has no {JOINT_STATE}; topics that have it:"
                f" {', '.join(topics) or 'none'}: correct joint_states.topic in the map",
                code="RID-BAG-TOPIC",
            )
        deserialize: Callable[..., Any] = reader.deserialize
        for connection, received_ns, raw in reader.messages(connections=wanted):
            yield received_ns, deserialize(raw, connection.msgtype)


def _joint_values(message: Any, names: Sequence[str]) -> list[float] | None:
    """Return positions, velocities and efforts, NaN if missing; None if no joint is named."""
    index = {name: i for i, name in enumerate(message.name)}
    places = [index.get(name) for name in names]
    if all(place is None for place in places):
        return None
    twice = [name for name in names if list(message.name).count(name) > 1]
    if len(index) < len(message.name) and twice:
        raise ConfigError(
            f"a message names joint {twice[0]} twice, so the arm's values are ambiguous. Record"
            " the arm's own topic, before other drivers are merged into it",
            code="RID-BAG-JOINT-TWICE",
        )
    row: list[float] = []
    for quantity in _QUANTITIES:
        values = getattr(message, quantity)
        complete = len(values) == len(message.name)
        row += [
            float(values[place]) if complete and place is not None else np.nan for place in places
        ]
    return row


def _odd_lengths(message: Any) -> str:
    """Return which values of a message cannot be assigned to its names; empty if all can be."""
    names = len(message.name)
    found = [(name, len(getattr(message, name))) for name in _QUANTITIES]
    odd = [f"{size} of {name}" for name, size in found if size not in (0, names)]
    return f" (a message has {names} joint names, but {', '.join(odd)})" if odd else ""


def _write_csv(path: Path, time_s: FloatArray, values: FloatArray) -> None:
    with (
        system_errors(ConfigError, f"{path}: cannot be written", code="RID-FILE-WRITE"),
        path.open("w", encoding="ascii") as file,
    ):
        for stamp, row in zip(time_s.tolist(), values, strict=True):
            fields = (repr(number) if number == number else "" for number in row.tolist())
            file.write(f"{stamp!r},{','.join(fields)}\n")
