"""Fields of a recording's rows, for recordings of the cyclic task and for imported recordings.

`row_layout` converts the fields to layouts for numpy and ROS 2.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import cache
from typing import Any, Final, NamedTuple, cast

import numpy as np

from acquisition.journal.header import Layout
from acquisition.journal.row_layout import Fields, packed_dtype
from config.quantities import MOST_JOINTS

MESSAGE_NAME = "rid_daq/msg/Cycle"

FIELDS: Fields = (
    ("time_s", "f8", 1, "time of SYNC on the cyclic task's clock [s]"),
    ("lateness_s", "f8", 1, "delay of the start of the cycle after its deadline [s]"),
    ("exchange_s", "f8", 1, "time from SYNC to the last drive's answer [s]"),
    ("target_position", "f8", None, "position set-point of the position loop [rad or m]"),
    ("target_velocity", "f8", None, "feedforward velocity of the position loop [rad/s or m/s]"),
    (
        "velocity_command",
        "f8",
        None,
        "velocity sent in this cycle; acts at next SYNC [rad/s or m/s]",
    ),
    ("position", "f8", None, "measured position, link side [rad or m]"),
    ("torque_nm", "f8", None, "measured torque or force, link side [N m or N]"),
    ("position_counts", "i4", None, "position (object 6064h) as received [increments]"),
    ("cycle", "u4", 1, "cycle times since the first cycle; a gap is an overrun"),
    ("sample_index", "i4", 1, "row of the motion; -1 outside the motion"),
    ("torque_raw", "i2", None, "torque (object 6077h) as received [0.1 % of rated torque]"),
    ("statusword", "u2", None, "statusword (object 6041h) as received"),
    ("valid", "u1", None, "1 if the drive answered plausibly, 0 if old values are repeated"),
    ("phase", "u1", 1, "0 approach, 1 run-in, 2 transient, 3 main, 4 run-out, 5 hold"),
)
IMPORTED_FIELDS: Final[Fields] = (
    ("time_s", "f8", 1, "time stamp of the source, or time rebuilt from its signals [s]"),
    ("position", "f8", None, "position, link side [rad or m]"),
    ("torque_nm", "f8", None, "torque or force, link side [N m or N]"),
    ("temperature_k", "f8", None, "temperature of the drive [K]; NaN if the source has none"),
    ("sample_index", "i8", 1, "row of the uniform time grid; -1 without a grid"),
    ("valid", "u1", 1, "1 if the row is near a measured row, else 0"),
    ("phase", "u1", 1, "phase of the motion, as in the rows of the cyclic task"),
)
COMMANDED_FIELDS: Final[Fields] = (
    *IMPORTED_FIELDS[:4],
    ("velocity_command", "f8", None, "velocity command of the source [rad/s or m/s]"),
    ("sample_index", "i4", 1, "row of the uniform time grid; -1 without a grid"),
    *IMPORTED_FIELDS[5:],
)
MESSAGES: Final[dict[Layout, tuple[str, Fields]]] = {
    "cell": (MESSAGE_NAME, FIELDS),
    "import": ("rid_daq/msg/Imported", IMPORTED_FIELDS),
    "commanded import": ("rid_daq/msg/ImportedCommands", COMMANDED_FIELDS),
}
"""Message name and fields of the rows, for each layout of `JournalHeader`."""
_STRUCT_CODE = {"f8": "d", "i4": "i", "u4": "I", "i2": "h", "u2": "H", "u1": "B"}


class CycleRow(NamedTuple):
    """One row of the cyclic task, with the units of `FIELDS`; each list has one value per joint."""

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
    """Return the numpy record type of a row, without padding, for a robot with `joints` joints."""
    return packed_dtype(FIELDS, joints)


@cache
def row_struct(joints: int) -> struct.Struct:
    """Return the layout of `row_dtype` for `struct`, which is faster than numpy for one row."""
    codes = (f"{count or joints}{_STRUCT_CODE[kind]}" for _, kind, count, _ in FIELDS)
    return struct.Struct("<" + "".join(codes))


def joints_of_row(size_bytes: int) -> int | None:
    """Return the number of joints of a row of `size_bytes`; None if no row has this size."""
    for joints in range(1, MOST_JOINTS + 1):
        if row_struct(joints).size == size_bytes:
            return joints
    return None
