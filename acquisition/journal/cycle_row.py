"""The row that the cyclic task writes once a cycle: one layout for memory, file and numpy.

The widest fields come first and all are of fixed size, so that a row's bytes are at once a packed
numpy record and, after four bytes of encapsulation header, the CDR (little endian) encoding of the
ROS 2 message that `message_definition` describes: PlotJuggler and Foxglove read it as it is.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple, cast

import numpy as np

CDR_LITTLE_ENDIAN = b"\x00\x01\x00\x00"
MESSAGE_NAME = "rid_daq/msg/Cycle"

_SCALARS_FIRST = (
    ("time_s", "f8", "SYNC, on the task's clock [s]"),
    ("lateness_s", "f8", "how late the cycle woke up after its deadline [s]"),
    ("exchange_s", "f8", "from SYNC to the last drive's answer [s]"),
)
_JOINTS_F8 = (
    ("target_position", "f8", "set-point of the position loop [rad or m]"),
    ("target_velocity", "f8", "its feedforward velocity [rad/s or m/s]"),
    ("velocity_command", "f8", "sent in this cycle, acts at the next SYNC [rad/s or m/s]"),
    ("position", "f8", "measured, link side [rad or m]"),
    ("torque_nm", "f8", "measured, link side [N m or N]"),
    ("position_counts", "i4", "6064h as received"),
)
_SCALARS_I4 = (
    ("cycle", "u4", "periods since the first cycle; a gap is an overrun"),
    ("sample_index", "i4", "row of the motion, -1 outside it"),
)
_JOINTS_SMALL = (
    ("torque_raw", "i2", "6077h as received [0.1 % of rated]"),
    ("statusword", "u2", "6041h"),
    ("valid", "u1", "1 where the drive answered plausibly, 0 where old values are held"),
)
_SCALARS_LAST = (("phase", "u1", "0 approach, 1 run-in, 2 transient, 3 main, 4 run-out, 5 hold"),)

_FIELDS: tuple[tuple[str, str, bool, str], ...] = (
    *((name, kind, False, text) for name, kind, text in _SCALARS_FIRST),
    *((name, kind, True, text) for name, kind, text in _JOINTS_F8),
    *((name, kind, False, text) for name, kind, text in _SCALARS_I4),
    *((name, kind, True, text) for name, kind, text in _JOINTS_SMALL),
    *((name, kind, False, text) for name, kind, text in _SCALARS_LAST),
)
_MESSAGE_TYPE = {
    "f8": "float64", "i4": "int32", "u4": "uint32", "i2": "int16", "u2": "uint16", "u1": "uint8",
}  # fmt: skip
_STRUCT_CODE = {"f8": "d", "i4": "i", "u4": "I", "i2": "h", "u2": "H", "u1": "B"}

MAX_JOINTS = 16


class CycleRow(NamedTuple):
    """One row by the names of its fields, whose units stand above; lists are (joints,)."""

    time_s: float
    lateness_s: float
    exchange_s: float
    target_position: Sequence[float]
    target_velocity: Sequence[float]
    velocity_command: Sequence[float]
    position: Sequence[float]
    torque_nm: Sequence[float]
    position_counts: Sequence[int]
    cycle: int
    sample_index: int
    torque_raw: Sequence[int]
    statusword: Sequence[int]
    valid: Sequence[int]
    phase: int

    def values(self) -> tuple[float, ...]:
        """Return all values in the order of `row_dtype`, as `row_struct` packs them."""
        values: list[float] = []
        fields = cast("tuple[Any, ...]", self)
        for value, (_, _, per_joint, _) in zip(fields, _FIELDS, strict=True):
            if per_joint:
                values += value
            else:
                values.append(value)
        return tuple(values)


@cache
def row_dtype(joints: int) -> np.dtype[Any]:
    """Return the packed record of a row for a robot with `joints` joints."""
    return np.dtype(
        [
            (name, "<" + kind, (joints,)) if per_joint else (name, "<" + kind)
            for name, kind, per_joint, _ in _FIELDS
        ]
    )


@cache
def row_struct(joints: int) -> struct.Struct:
    """Return the same layout for `struct`, which is faster than numpy for one row."""
    return struct.Struct(
        "<"
        + "".join(
            f"{joints if per_joint else 1}{_STRUCT_CODE[kind]}" for _, kind, per_joint, _ in _FIELDS
        )
    )


def joints_of_row(size_bytes: int) -> int | None:
    """Return how many joints a row of `size_bytes` has, None where no row has that size."""
    for joints in range(1, MAX_JOINTS + 1):
        if row_struct(joints).size == size_bytes:
            return joints
    return None


def message_definition(joints: int) -> str:
    """Return the ROS 2 message definition (`.msg` text) of a row."""
    return "".join(
        f"{_MESSAGE_TYPE[kind]}{f'[{joints}]' if per_joint else ''} {name}  # {text}\n"
        for name, kind, per_joint, text in _FIELDS
    )
