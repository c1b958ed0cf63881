"""`read_message_arrays`: reads the numbers in the messages of an MCAP file or a ROS bag."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np

from acquisition.sources.array_files import Array
from acquisition.sources.bags import ros_messages
from config.errors import ConfigError, RidDaqError, missing_library, system_errors

RECORDING_TIME: Final = "log_time"
"""Array with the time at which a message was recorded, in whole nanoseconds since 1970."""

_ROS_ENCODINGS: Final = ("cdr", "ros1")
Decode = Callable[[bytes], object]
_Messages = Iterator[tuple[str, int, object]]


def has_ros_messages(path: Path) -> bool:
    """Return True if a bag has messages of ROS; an MCAP file can have others only.

    Raises:
        ConfigError: The file cannot be read.
    """
    if path.suffix != ".mcap":
        return True
    with _read_errors(path), path.open("rb") as file:
        return bool(_encodings(file) & set(_ROS_ENCODINGS))


def read_message_arrays(path: Path, names: Sequence[str] | None = None) -> dict[str, Array]:
    """Return the numbers in the messages of a file, one array per topic and field.

    Arrays are named `topic.field`, for example `/robot_state.q`; a field within a field is
    `topic.field.part`, and element 0 of a list of messages is `topic.field[0]`. A list of numbers
    becomes an array with one row per message. Each topic also has the array `topic.log_time`. A
    value that is null in some messages is NaN. Text, lists whose length varies, and fields that
    some messages lack are left out.

    Args:
        path: An MCAP file with ROS messages, JSON or Protocol Buffers, or a ROS bag.
        names: Arrays to read; all if None.

    Raises:
        ConfigError: The file cannot be read, or the library for its messages is not installed.
    """
    columns: dict[str, list[Any]] = {}
    counts: dict[str, int] = {}

    def is_wanted(topic: str) -> bool:
        return names is None or any(name.startswith(f"{topic}.") for name in names)

    with _read_errors(path):
        for topic, received_ns, message in _messages(path, is_wanted):
            counts[topic] = counts.get(topic, 0) + 1
            columns.setdefault(f"{topic}.{RECORDING_TIME}", []).append(received_ns)
            for field, value in _leaves(message):
                columns.setdefault(f"{topic}.{field}", []).append(value)
    topic_of = {name: topic for topic in counts for name in columns if name.startswith(f"{topic}.")}
    arrays: dict[str, Array] = {}
    for name, values in columns.items():
        present = [value for value in values if value is not None]
        lengths = {len(value) if isinstance(value, list) else -1 for value in present}
        if len(values) == counts[topic_of[name]] and len(lengths) == 1 and 0 not in lengths:
            n = lengths.pop()
            missing = np.nan if n < 0 else [np.nan] * n
            array = np.array([missing if value is None else value for value in values])
            if array.dtype.kind in "biuf":
                arrays[name] = array
    return arrays


@contextlib.contextmanager
def _read_errors(path: Path) -> Iterator[None]:
    """Turn the errors of the libraries, which raise many types, into a `ConfigError`."""
    try:
        with system_errors(ConfigError, f"cannot read {path}", code="RID-FILE-READ"):
            yield
    except (RidDaqError, MemoryError):
        raise
    except Exception as error:
        raise ConfigError(
            f"{path}: its messages cannot be read: {type(error).__name__}: {error}",
            code="RID-FILE-TYPE",
        ) from error


def _leaves(message: object, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the numbers, and the lists of numbers, of a message, each with its path."""
    for name, value in _fields(message):
        path = f"{prefix}{name}"
        if value is None or isinstance(value, (bool, int, float)):
            yield path, value
        elif isinstance(value, np.ndarray):
            yield path, value.tolist()
        elif isinstance(value, (list, tuple)):
            if all(each is None or isinstance(each, (bool, int, float)) for each in value):
                yield path, [np.nan if each is None else each for each in value]
            else:
                for number, each in enumerate(value):
                    yield from _leaves(each, f"{path}[{number}].")
        elif not isinstance(value, (str, bytes)):
            yield from _leaves(value, f"{path}.")


def _fields(message: object) -> list[tuple[str, Any]]:
    if isinstance(message, Mapping):
        return [(str(name), value) for name, value in message.items()]
    if is_dataclass(message):
        return [(field.name, getattr(message, field.name)) for field in fields(message)]
    descriptor = getattr(message, "DESCRIPTOR", None)  # a message of Protocol Buffers
    if descriptor is None:
        return []
    found = [(field.name, getattr(message, field.name)) for field in descriptor.fields]
    return [(name, list(value) if hasattr(value, "extend") else value) for name, value in found]


def _messages(path: Path, is_wanted: Callable[[str], bool]) -> _Messages:
    if path.suffix != ".mcap":
        yield from ros_messages(path, lambda topic, _: is_wanted(topic))
        return
    from mcap.reader import make_reader

    with path.open("rb") as file:
        if _encodings(file, is_wanted) & set(_ROS_ENCODINGS):
            yield from ros_messages(path, lambda topic, _: is_wanted(topic))
        decoders: dict[int, Decode] = {}
        for schema, channel, record in make_reader(file).iter_messages():
            if channel.message_encoding in _ROS_ENCODINGS or not is_wanted(channel.topic):
                continue
            if channel.id not in decoders:
                decoders[channel.id] = _decoder(path, channel.message_encoding, schema)
            yield channel.topic, record.log_time, decoders[channel.id](record.data)


def _encodings(
    file: BinaryIO, is_wanted: Callable[[str], bool] = lambda topic: True
) -> frozenset[str]:
    """Return the encodings of the messages of the wanted topics of an MCAP file."""
    from mcap.reader import make_reader

    summary = make_reader(file).get_summary()
    channels = {} if summary is None else summary.channels
    return frozenset(each.message_encoding for each in channels.values() if is_wanted(each.topic))


def _decoder(path: Path, encoding: str, schema: Any) -> Decode:
    """Return the function that decodes the messages of a channel."""
    if encoding == "json":
        return json.loads
    if encoding != "protobuf":
        raise ConfigError(
            f"{path}: messages of encoding {encoding!r} cannot be read: record ROS messages, JSON"
            " or Protocol Buffers",
            code="RID-FILE-TYPE",
        )
    try:
        from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
    except ImportError:
        raise missing_library(f"{path}: Protocol Buffers", "protobuf") from None
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(schema.data).file:
        pool.Add(file)
    message_class = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
    decode: Decode = message_class.FromString
    return decode
