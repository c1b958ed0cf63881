"""`bag_as_table`: the JointState messages of a ROS bag or MCAP file as a CSV file with its own map.

What is kept of a bag is what was read of it: one topic, every number to its last digit, in its own
units and signs; the map of the table says what they mean.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.imports.import_map import ImportJoint, ImportMap, JointReading, TimeColumn
from config.arrays import FloatArray
from config.errors import ConfigError, DataQualityError, RidDaqError, system_errors

JOINT_STATE = "sensor_msgs/msg/JointState"
BAG_ENDINGS = (".db3", ".mcap", ".bag")
_QUANTITIES = ("position", "velocity", "effort")
_KEPT = ("name", "robot", "units", "side", "plausible", "left_out_limit", "rows", "period_s")


def is_bag(path: Path) -> bool:
    """Return whether a path looks like a bag: a file by its ending, or a folder with metadata."""
    return path.suffix in BAG_ENDINGS or (path / "metadata.yaml").is_file()


def bag_as_table(
    path: Path, import_map: ImportMap, joint_names: tuple[str, ...], table: Path
) -> ImportMap:
    """Write the messages of a bag as a CSV file, one message a row.

    Columns are the time since the first message, and the joints' positions, velocities (where there
    are any) and efforts. Time is the stamp in the message's header, or when it was recorded where
    the stamps stand still. Messages without any of the joints are of another device and ignored;
    what lacks in a message is empty.

    Args:
        path: A bag's folder, or a file `.db3`, `.mcap` or `.bag`.
        import_map: A map with `joint_states`.
        joint_names: The robot's joints, base to flange.
        table: The CSV file to write.

    Returns:
        How the file is to be read.

    Raises:
        ConfigError: It cannot be read, has no such topic or several, or does not name the joints.
        DataQualityError: Its messages have no efforts.
    """
    states = import_map.joint_states
    assert states is not None
    if not is_bag(path):
        known = ", ".join(BAG_ENDINGS)
        raise ConfigError(
            f"{path}: is no bag (a folder with metadata.yaml, or a file {known}), which map"
            f" {import_map.name!r} reads joint_states of",
            code="RID-FILE-TYPE",
        )
    if not path.exists():
        raise ConfigError(f"cannot read {path}: there is no such file", code="RID-FILE-UNKNOWN")
    n, names = len(joint_names), states.names or joint_names
    stamps, received, numbers = array("q"), array("q"), array("d")
    try:
        for received_ns, message in _messages(path, states.topic):
            row = _row(message, names)
            if row is not None:
                received.append(received_ns)
                stamps.append(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)
                numbers.extend(row)
    except ConfigError as error:
        place = "" if str(error).startswith(str(path)) else f"{path}: "
        raise ConfigError(f"{place}{error}", code=error.refusal) from None
    except (RidDaqError, MemoryError):
        raise
    except Exception as error:  # whatever a damaged file makes the library stumble over
        raise ConfigError(
            f"{path}: cannot be read as a bag: {type(error).__name__}: {error}",
            code="RID-FILE-TYPE",
        ) from error
    if not stamps:
        raise ConfigError(
            f"{path}: no message names a joint of the robot ({', '.join(names)}): say in"
            " joint_states.names how the messages name them",
            code="RID-BAG-TOPIC",
        )
    values = np.frombuffer(numbers, dtype=np.float64).reshape(-1, 3, n)
    there = np.array([bool(np.isfinite(values[:, i]).any()) for i in range(len(_QUANTITIES))])
    if not there[2]:
        raise DataQualityError(
            f"{path}: its messages have no efforts: record a topic that has torques or currents",
            code="RID-BAG-TOPIC",
        )
    moving = np.ptp(np.frombuffer(stamps, dtype=np.int64)) > 0
    times = np.frombuffer(stamps if moving else received, dtype=np.int64)
    _write(table, (times - times[0]) * 1e-9, values[:, there].reshape(len(times), -1))
    efforts, is_torque = 1 + (1 + int(there[1])) * n, states.effort == "torque"
    said = {joint.joint: joint for joint in states.joints}
    joints = tuple(
        ImportJoint(
            **said.get(name, JointReading(joint=name)).model_dump(),
            position=1 + i,
            velocity=1 + n + i if there[1] else None,
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
            _moved(name, places) for name in import_map.implausible_on_purpose
        ),
        columns=1 + int(there.sum()) * n,
        time=TimeColumn(column=0),
        joints=joints,
    )


def _moved(key: str, places: Mapping[str, str]) -> str:
    """Return a key under the place that its joint has in the table's map."""
    old = next((old for old in places if key.startswith(old)), "")
    return places.get(old, "") + key.removeprefix(old)


def _messages(path: Path, topic: str | None) -> Iterator[tuple[int, Any]]:
    """Yield when messages were recorded [ns], and the messages of one topic."""
    from rosbags.highlevel import AnyReader  # slow: here
    from rosbags.typesys import Stores, get_typestore

    with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
        found = [each for each in reader.connections if each.msgtype == JOINT_STATE]
        topics = sorted({each.topic for each in found})
        if topic is None and len(topics) != 1:
            what = "several topics" if topics else "no topic"
            there = topics or sorted({each.topic for each in reader.connections})
            raise ConfigError(
                f"{path}: has {what} of {JOINT_STATE}; there are: {', '.join(there) or 'none'}."
                " Name one in the map: joint_states.topic",
                code="RID-BAG-TOPIC",
            )
        wanted = [each for each in found if topic in (None, each.topic)]
        if not wanted:
            raise ConfigError(
                f"{path}: topic {topic} has no {JOINT_STATE}; such topics are:"
                f" {', '.join(topics) or 'none'}",
                code="RID-BAG-TOPIC",
            )
        deserialize: Callable[..., Any] = reader.deserialize
        for connection, received_ns, raw in reader.messages(connections=wanted):
            yield received_ns, deserialize(raw, connection.msgtype)


def _row(message: Any, names: Sequence[str]) -> list[float] | None:
    """Return positions, velocities and efforts of joints; NaN for what lacks, None without any."""
    index = {name: i for i, name in enumerate(message.name)}
    places = [index.get(name) for name in names]
    if all(place is None for place in places):
        return None
    twice = [name for name in names if list(message.name).count(name) > 1]
    if len(index) < len(message.name) and twice:
        raise ConfigError(
            f"a message names joint {twice[0]} twice: it does not say which of its values are the"
            " arm's. Record the arm's own topic, before other drivers are merged into it",
            code="RID-BAG-JOINT-TWICE",
        )
    row: list[float] = []
    for quantity in _QUANTITIES:
        values = getattr(message, quantity)
        there = len(values) == len(message.name)
        row += [float(values[place]) if there and place is not None else np.nan for place in places]
    return row


def _write(path: Path, time_s: FloatArray, values: FloatArray) -> None:
    with (
        system_errors(ConfigError, f"{path}: cannot be written", code="RID-FILE-WRITE"),
        path.open("w", encoding="ascii") as file,
    ):
        for stamp, row in zip(time_s.tolist(), values, strict=True):
            fields = (repr(number) if number == number else "" for number in row.tolist())
            file.write(f"{stamp!r},{','.join(fields)}\n")
