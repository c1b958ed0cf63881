"""Rows of a recording: those of the cyclic task, and those of an import.

The layouts are defined in `row_layout`.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import cache
from typing import Any, Final, Literal, NamedTuple, cast

import numpy as np

from acquisition.journal.row_layout import Fields, packed_dtype

MESSAGE_NAME = "rid_daq/msg/Cycle"

FIELDS: Fields = (
    ("time_s", "f8", 1, "SYNC, on the task's clock [s]"),
    ("lateness_s", "f8", 1, "delay of the cycle after its deadline [s]"),
    ("exchange_s", "f8", 1, "from SYNC to the last drive's answer [s]"),
    ("target_position", "f8", None, "set-point of the position loop [rad or m]"),
    ("target_velocity", "f8", None, "its feedforward velocity [rad/s or m/s]"),
    ("velocity_command", "f8", None, "sent in this cycle, acts at the next SYNC [rad/s or m/s]"),
    ("position", "f8", None, "measured, link side [rad or m]"),
    ("torque_nm", "f8", None, "measured, link side [N m or N]"),
    ("position_counts", "i4", None, "6064h as received"),
    ("cycle", "u4", 1, "periods since the first cycle; a gap is an overrun"),
    ("sample_index", "i4", 1, "row of the motion, -1 outside it"),
    ("torque_raw", "i2", None, "6077h as received [0.1 % of rated]"),
    ("statusword", "u2", None, "6041h"),
    ("valid", "u1", None, "1 if the drive answered plausibly, 0 if old values are held"),
    ("phase", "u1", 1, "0 approach, 1 run-in, 2 transient, 3 main, 4 run-out, 5 hold"),
)
IMPORTED_FIELDS: Final[Fields] = (
    ("time_s", "f8", 1, "stamp of the source, or the time that was rebuilt from its signals [s]"),
    ("position", "f8", None, "link side [rad or m]"),
    ("torque_nm", "f8", None, "link side [N m or N]"),
    ("temperature_k", "f8", None, "of the drive [K]; NaN if the source has none"),
    ("sample_index", "i8", 1, "row of the grid, -1 without a grid"),
    ("valid", "u1", 1, "1 if the row is near a measured one"),
    ("phase", "u1", 1, "as of a cycle"),
)
MESSAGES: Final[dict[Literal["cell", "import"], tuple[str, Fields]]] = {
    "cell": (MESSAGE_NAME, FIELDS),
    "import": ("rid_daq/msg/Imported", IMPORTED_FIELDS),
}
"""Name and layout of the rows, by the source of a recording."""
_STRUCT_CODE = {"f8": "d", "i4": "i", "u4": "I", "i2": "h", "u2": "H", "u1": "B"}

MAX_JOINTS = 16


class CycleRow(NamedTuple):
    """One row by the names of its fields, with the units above; lists are (joints,)."""

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
        for value, (_, _, count, _) in zip(fields, FIELDS, strict=True):
            if count is None:
                values += value
            else:
                values.append(value)
        return tuple(values)


@cache
def row_dtype(joints: int) -> np.dtype[Any]:
    """Return the packed record of a row for a robot with `joints` joints."""
    return packed_dtype(FIELDS, joints)


@cache
def row_struct(joints: int) -> struct.Struct:
    """Return the same layout for `struct`, which is faster than numpy for one row."""
    codes = (f"{count or joints}{_STRUCT_CODE[kind]}" for _, kind, count, _ in FIELDS)
    return struct.Struct("<" + "".join(codes))


def joints_of_row(size_bytes: int) -> int | None:
    """Return the number of joints of a row of `size_bytes`; None if no row has this size."""
    for joints in range(1, MAX_JOINTS + 1):
        if row_struct(joints).size == size_bytes:
            return joints
    return None
