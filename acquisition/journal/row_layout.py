"""Rows of fixed size: one layout for memory, file, numpy, and a ROS 2 message.

If the widest fields come first, the bytes of a row are a packed numpy record and also, after four
bytes of encapsulation header, the CDR (little endian) encoding of the message in `message_text`.
Therefore PlotJuggler and Foxglove can read the files.
"""

from __future__ import annotations

from typing import Any

import numpy as np

CDR_LITTLE_ENDIAN = b"\x00\x01\x00\x00"
_MESSAGE_TYPE = {
    "f8": "float64", "f4": "float32", "i8": "int64", "i4": "int32", "i2": "int16",
    "u4": "uint32", "u2": "uint16", "u1": "uint8",
}  # fmt: skip

Fields = tuple[tuple[str, str, int | None, str], ...]
"""Fields of a row. Each has a name, a numpy kind, the number of values (None: one per joint), and a
comment with the unit."""


def packed_dtype(fields: Fields, joints: int = 1) -> np.dtype[Any]:
    """Return the numpy record type of a row, without padding, for a robot with `joints` joints."""
    return np.dtype(
        [
            (name, "<" + kind) if count == 1 else (name, "<" + kind, (count or joints,))
            for name, kind, count, _ in fields
        ]
    )


def message_text(fields: Fields, joints: int = 1) -> str:
    """Return the ROS 2 message definition (`.msg` text) of a row."""
    return "".join(
        f"{_MESSAGE_TYPE[kind]}{'' if count == 1 else f'[{count or joints}]'} {name}  # {text}\n"
        for name, kind, count, text in fields
    )
