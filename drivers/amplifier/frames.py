"""`FrameLayout`: conversion of a charge amplifier's rows and events to bytes and back.

Every frame begins with a literal, has a fixed size and ends with CRC-16/CCITT (polynomial 0x1021,
from 0xFFFF, no final exclusive-or) of everything before it, high byte first.
"""

from __future__ import annotations

import struct
from binascii import crc_hqx
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from config.cell.amplifier_profile import AmplifierProfile, Part
from config.cell.plate import CHANNELS

PLATE_ROW: Final = np.dtype(
    [
        ("sequence", "<i8"),
        ("ticks", "<i8"),
        ("stream", "<u4"),
        ("status", "<u2"),
        ("counts", "<i2", (CHANNELS,)),
    ]
)
"""A row of measured values. `sequence` is its number and `ticks` its time on the amplifier's clock;
both continue to grow when the amplifier's own counters overflow. `stream` grows when the
amplifier's clock restarts: times of two streams cannot be compared, but the later stream has the
larger number. `status` and `counts` are as sent.
"""

PLATE_EVENT: Final = np.dtype(
    [("sequence", "<i8"), ("ticks", "<i8"), ("stream", "<u4"), ("kind", "<u2"), ("detail", "<u2")]
)
"""An event in the stream of rows. `sequence` is the number of the row after it, `ticks` its time on
the amplifier's clock. The profile defines the meaning of `detail`.
"""

_SEED = 0xFFFF
_HEX_DIGIT = np.full(256, 255, dtype=np.uint8)
_HEX_DIGIT[list(b"0123456789ABCDEF")] = np.arange(16)
_HEX_DIGIT[list(b"abcdef")] = np.arange(10, 16)


class FrameLayout:
    """Layout of one type of frame.

    Attributes:
        start: First bytes of a frame.
        size: Number of bytes of a frame, including the checksum.
        terminator: Bytes that follow the frame on the line; they are not part of the frame.
    """

    def __init__(self, parts: tuple[Part, ...], terminator: bytes) -> None:
        self.start = parts[0].literal
        self.size = sum(part.size for part in parts)
        self.terminator = terminator
        self._parts = parts
        self._is_text = any(part.kind == "hex" for part in parts)
        self._body = self.size - parts[-1].size
        if self._is_text:
            self._encode = _text_format(parts[:-1])
        else:
            self._struct = struct.Struct("<" + "".join(_code(part) for part in parts[:-1]))
            self._record = np.dtype(
                [
                    (part.name or f"literal{i}", _numpy_kind(part), (part.repeat,))
                    if part.repeat > 1
                    else (part.name or f"literal{i}", _numpy_kind(part))
                    for i, part in enumerate(parts)
                ]
            )

    def encode(self, values: dict[str, int | Sequence[int]]) -> bytes:
        """Return a frame with its terminator; `values` has every number except the checksum.

        Raises:
            struct.error, ValueError: A number does not fit.
        """
        spread: list[Any] = []
        for part in self._parts[:-1]:
            if part.kind == "literal":
                if not self._is_text:
                    spread.append(part.literal)
                continue
            value = values[part.name]
            spread += [value] if isinstance(value, (int, np.integer)) else list(value)
        if not self._is_text:
            body = self._struct.pack(*spread)
            return body + crc_hqx(body, _SEED).to_bytes(2, "big") + self.terminator
        body = (self._encode % tuple(spread)).encode("ascii")
        if len(body) != self._body:
            raise ValueError(f"{values} does not fit into {self._body} characters")
        return body + b"%04X" % crc_hqx(body, _SEED) + self.terminator

    def is_whole(self, data: bytes, position: int) -> bool:
        """Return True if the complete frame at `position` is undamaged."""
        if not self._is_text:
            return crc_hqx(data[position : position + self.size], _SEED) == 0
        end = position + self._body
        checksum = b"%04X" % crc_hqx(data[position:end], _SEED)
        return data[end : position + self.size].upper() == checksum

    def decode(self, frames: bytes) -> tuple[dict[str, NDArray[np.int64]], NDArray[np.bool_]]:
        """Return the numbers of complete frames, concatenated without terminators.

        Returns:
            `fields`: Dict from the name of a number to its values, ndarray of int64, shape
                (frames,) or (frames, 8).
            `good`, shape (frames,). False if a text frame has something other than a number at the
                position of a number.
        """
        if not self._is_text:
            records = np.frombuffer(frames, dtype=self._record)
            fields = {
                part.name: records[part.name].astype(np.int64)
                for part in self._parts[:-1]
                if part.name
            }
            return fields, np.ones(len(records), dtype=np.bool_)
        characters = np.frombuffer(frames, dtype=np.uint8).reshape(-1, self.size)
        digits = _HEX_DIGIT[characters]
        good = np.ones(len(characters), dtype=np.bool_)
        fields = {}
        column = 0
        for part in self._parts[:-1]:
            end = column + part.size
            if part.kind == "hex":
                block = digits[:, column:end]
                good &= (block < 16).all(axis=1)
                fields[part.name] = block.astype(np.int64) @ _powers(16, part.width)
            elif part.kind == "dec":
                shape = (-1, part.repeat, part.width)
                signs = characters[:, column:end].reshape(shape)[:, :, 0]
                block = digits[:, column:end].reshape(shape)[:, :, 1:]
                good &= (block < 10).all(axis=(1, 2))
                good &= ((signs == ord("+")) | (signs == ord("-"))).all(axis=1)
                size = block.astype(np.int64) @ _powers(10, part.width - 1)
                numbers = np.where(signs == ord("-"), -size, size)
                good &= (np.abs(numbers + 0.5) < 32768.0).all(axis=1)
                fields[part.name] = numbers
            column = end
        return fields, good


def row_layout(profile: AmplifierProfile, form: str) -> FrameLayout:
    """Return the layout of a row in the form ``ascii`` or ``binary``."""
    return FrameLayout(profile.row_parts(form), _terminator(profile, form))


def event_layout(profile: AmplifierProfile, form: str) -> FrameLayout:
    """Return the layout of an event in the form ``ascii`` or ``binary``."""
    return FrameLayout(profile.event_parts(form), _terminator(profile, form))


def encode_row(
    layout: FrameLayout, sequence: int, ticks: int, status: int, counts: Sequence[int]
) -> bytes:
    """Return a row as bytes on the line; `sequence` and `ticks` overflow as on the device.

    Raises:
        struct.error, ValueError: There are not eight counts, or one does not fit 16 bits.
    """
    if len(counts) != CHANNELS:
        raise ValueError(f"{len(counts)} counts for {CHANNELS} channels")
    return layout.encode(
        {
            "sequence": sequence & 0xFFFF,
            "time": ticks & 0xFFFF_FFFF,
            "status": status,
            "counts": counts,
        }
    )


def encode_event(layout: FrameLayout, kind: int, sequence: int, ticks: int, detail: int) -> bytes:
    """Return an event as bytes on the line; numbers overflow as on the device."""
    return layout.encode(
        {
            "kind": kind,
            "sequence": sequence & 0xFFFF,
            "time": ticks & 0xFFFF_FFFF,
            "detail": detail & 0xFFFF,
        }
    )


def _terminator(profile: AmplifierProfile, form: str) -> bytes:
    return b"" if form == "binary" else profile.terminator.encode("ascii")


def _text_format(parts: tuple[Part, ...]) -> str:
    pieces = []
    for part in parts:
        if part.kind == "literal":
            pieces.append(part.literal.decode("ascii").replace("%", "%%"))
        else:
            pieces.append(
                (f"%0{part.width}X" if part.kind == "hex" else f"%+0{part.width}d") * part.repeat
            )
    return "".join(pieces)


def _code(part: Part) -> str:
    if part.kind == "literal":
        return f"{part.width}s"
    codes = {("u", 2): "H", ("u", 4): "I", ("i", 2): "h"}
    return codes[part.kind, part.width] * part.repeat


def _numpy_kind(part: Part) -> str:
    return f"V{part.width}" if part.kind == "literal" else f"<{part.kind}{part.width}"


def _powers(base: int, count: int) -> NDArray[np.int64]:
    return np.array([base ** (count - 1 - i) for i in range(count)], dtype=np.int64)
