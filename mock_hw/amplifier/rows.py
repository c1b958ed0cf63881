"""Encoding of blocks of rows as bytes, fast enough for thousands of rows per second."""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.cell.amplifier_profile import AmplifierProfile, Part
from drivers.amplifier.frames import encode_row, row_layout

Integers = NDArray[np.int64]
RowEncoder = Callable[[Integers, Integers, Integers, NDArray[np.int16]], bytes]

_CRC_SEED = 0xFFFF


@dataclass(frozen=True, eq=False)
class RowBlock:
    """A block of encoded rows, all with the same number of bytes.

    Attributes:
        data: Bytes of all rows.
        size: Bytes per row.
        ready_s: Shape (rows,). Earliest times at which the rows can be sent [s].
        sequence: Shape (rows,). Numbers of the rows.
    """

    data: bytes
    size: int
    ready_s: NDArray[np.float64]
    sequence: Integers


def row_encoder(profile: AmplifierProfile, form: str) -> RowEncoder:
    """Return a function that encodes rows: sequence numbers, ticks, status words and counts."""
    parts = profile.row_parts(form)
    if any(part.kind in ("hex", "dec") for part in parts):
        return _text_encoder(profile, form)
    dtype = np.dtype([_field(place, part) for place, part in enumerate(parts)])
    template = np.zeros(1, dtype)
    for place, part in enumerate(parts):
        if part.kind == "literal":
            template[_field_name(place, part)] = np.frombuffer(part.literal, np.uint8)
    body = dtype.itemsize - parts[-1].size

    def encode(
        sequence: Integers, ticks: Integers, status: Integers, counts: NDArray[np.int16]
    ) -> bytes:
        rows = np.repeat(template, len(sequence))
        rows["sequence"] = sequence & 0xFFFF
        rows["time"] = ticks & 0xFFFF_FFFF
        rows["status"] = status
        rows["counts"] = counts
        whole = rows.tobytes()
        checksums = [
            crc_hqx(whole[start : start + body], _CRC_SEED)
            for start in range(0, len(whole), dtype.itemsize)
        ]
        rows["checksum"] = checksums
        return rows.tobytes()

    return encode


def _text_encoder(profile: AmplifierProfile, form: str) -> RowEncoder:
    layout = row_layout(profile, form)

    def encode(
        sequence: Integers, ticks: Integers, status: Integers, counts: NDArray[np.int16]
    ) -> bytes:
        columns = zip(
            sequence.tolist(), ticks.tolist(), status.tolist(), counts.tolist(), strict=True
        )
        return b"".join(encode_row(layout, *row) for row in columns)

    return encode


def _field_name(place: int, part: Part) -> str:
    return part.name or f"literal{place}"


def _field(place: int, part: Part) -> tuple[str, str, tuple[int, ...]]:
    """Return the NumPy field for one part of a row; the checksum is big-endian."""
    if part.kind == "literal":
        return _field_name(place, part), "u1", (part.width,)
    order = ">" if part.name == "checksum" else "<"
    shape = (part.repeat,) if part.repeat > 1 else ()
    return _field_name(place, part), f"{order}{part.kind}{part.width}", shape
