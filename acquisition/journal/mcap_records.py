"""Parser for records of an MCAP file: frames, string maps, summary."""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from typing import BinaryIO

from config.errors import RecordingError

METADATA_NAME = "rid_daq.header"
CHANNEL, MESSAGE, MESSAGE_INDEX = 0x04, 0x05, 0x07
_FOOTER, _STATISTICS = 0x02, 0x0B
HEAD_BYTES = 1 << 16  # first bytes of a file, which contain a header
RECORD = struct.Struct("<BQ")
MESSAGE_HEAD = struct.Struct("<HIQQ")
_MAGIC = b"\x89MCAP0\r\n"
_FOOTER_BODY = struct.Struct("<QQI")
_TAIL_BYTES = RECORD.size + _FOOTER_BODY.size + len(_MAGIC)


def records_of(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, start and end of the body of every record.

    Raises:
        RecordingError: The last record is cut, or a message record is too short.
    """
    position = 0
    while position < len(data):
        if position + RECORD.size > len(data):
            raise RecordingError(
                "a record is cut inside a chunk whose checksum is right",
                code="RID-RECORDING-DAMAGED",
            )
        opcode, length = RECORD.unpack_from(data, position)
        start = position + RECORD.size
        position = start + length
        if position > len(data) or (opcode == MESSAGE and length < MESSAGE_HEAD.size):
            raise RecordingError(
                "a record is cut inside a chunk whose checksum is right",
                code="RID-RECORDING-DAMAGED",
            )
        yield opcode, start, position


def _pairs(data: bytes, position: int) -> dict[str, str] | None:
    """Read an MCAP map of strings; None if the bytes are not such a map."""
    texts, end = [], position + 4
    try:
        end += struct.unpack_from("<I", data, position)[0]
        position += 4
        while position < end:
            size = struct.unpack_from("<I", data, position)[0]
            if position + 4 + size > min(end, len(data)):
                return None
            texts.append(data[position + 4 : position + 4 + size].decode())
            position += 4 + size
    except (struct.error, UnicodeDecodeError):
        return None
    return dict(zip(texts[0::2], texts[1::2], strict=False))


def metadata_pairs(data: bytes) -> dict[str, str] | None:
    """Return the pairs of the metadata record near the file's start; None if damaged."""
    name = struct.pack("<I", len(METADATA_NAME)) + METADATA_NAME.encode()
    start = data.find(name, 0, HEAD_BYTES)
    if start < 0:
        return None
    return _pairs(data[start : start + HEAD_BYTES], len(name))


def channel_pairs(body: bytes) -> dict[str, str] | None:
    """Return a channel record's last part, the metadata; None if the record cannot be read."""
    try:
        position = 4
        for _ in range(2):
            position += 4 + struct.unpack_from("<I", body, position)[0]
    except struct.error:
        return None
    return _pairs(body, position)


def _summary_start(tail: bytes) -> int | None:
    """Return the position of a finished file's summary; None if the last bytes name no summary."""
    if len(tail) < _TAIL_BYTES or tail[-len(_MAGIC) :] != _MAGIC:
        return None
    opcode, length = RECORD.unpack_from(tail)
    start: int = _FOOTER_BODY.unpack_from(tail, RECORD.size)[0]
    return start if opcode == _FOOTER and length == _FOOTER_BODY.size and start > 0 else None


def count_written(file: BinaryIO) -> int | None:
    """Return the number of messages in a finished file's summary; None without a sound summary."""
    descriptor = file.fileno()
    size = os.fstat(descriptor).st_size
    begin = _summary_start(os.pread(descriptor, _TAIL_BYTES, max(0, size - _TAIL_BYTES)))
    if begin is None or begin > size - _TAIL_BYTES:
        return None
    data = os.pread(descriptor, size - begin, begin)
    tail = len(data) - _TAIL_BYTES
    crc = _FOOTER_BODY.unpack_from(data, tail + RECORD.size)[2]
    if zlib.crc32(data[: tail + RECORD.size + 16]) != crc:
        return None
    for opcode, start, end in records_of(data[:tail]):
        if opcode == _STATISTICS and end - start >= 8:
            return int(struct.unpack_from("<Q", data, start)[0])
    return None
