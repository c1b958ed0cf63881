"""`RawJournal`: the messages of an MCAP file, finished, unfinished, torn or damaged.

A chunk is taken only where its frame is consistent and its CRC right, wherever it stands; the
bytes in it are then those that were written. What is missing is found by the messages' own sequence
numbers and, in a finished file, by the count in its summary. Record framing is not trusted, so a
single damaged length cannot hide what follows it.
"""

from __future__ import annotations

import os
import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from config.errors import RecordingError
from config.formats.bounded_file import read_file

MAX_CHUNK_BYTES = 1 << 20
MAX_FILE_BYTES = 4_000_000_000
METADATA_NAME = "rid_daq.header"

_MAGIC = b"\x89MCAP0\r\n"
_FOOTER, _STATISTICS, _CHANNEL, _MESSAGE, _MESSAGE_INDEX = 0x02, 0x0B, 0x04, 0x05, 0x07
_RECORD = struct.Struct("<BQ")
# opcode, record length, first and last time, uncompressed size, CRC, length of the (empty)
# name of the compression, size of the records
_CHUNK = struct.Struct("<BQQQQIIQ")
_MAYBE_CHUNK = re.compile(rb"\x06(?=.{4}\0{4}.{16}.{4}\0{4}.{4}\0{4}.{4}\0{4})", re.DOTALL)
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_FOOTER_BODY = struct.Struct("<QQI")
_TAIL_BYTES = _RECORD.size + _FOOTER_BODY.size + len(_MAGIC)


@dataclass(frozen=True)
class JournalDamage:
    """What a journal has lost.

    Attributes
    ----------
    finished : bool
        The recorder closed the file. Otherwise rows after the last one may be missing.
    gaps : tuple of (int, int)
        First row missing and how many, counted from row 0.
    bad_chunks : int
        Chunks that were there and failed their CRC.
    torn_bytes : int
        Bytes after the last readable chunk of a file that was not closed.
    """

    finished: bool
    gaps: tuple[tuple[int, int], ...]
    bad_chunks: int
    torn_bytes: int = 0

    @property
    def rows_lost(self) -> int:
        """Rows known to be missing."""
        return sum(count for _, count in self.gaps)

    @property
    def notes(self) -> tuple[str, ...]:
        """What is wrong, one sentence each; empty where nothing is."""
        notes = [
            f"rows {first} to {first + count - 1} are lost ({count} rows)"
            for first, count in self.gaps
        ]
        if self.bad_chunks:
            notes.append(f"{self.bad_chunks} blocks fail their checksum and were left out")
        if self.torn_bytes:
            notes.append(f"the last {self.torn_bytes} bytes are torn and were left out")
        if not self.finished:
            notes.append("the file was not closed: rows after the last one may be missing")
        return tuple(notes)


@dataclass(frozen=True, eq=False)
class RawJournal:
    """The messages of a file whose checksums are right.

    Attributes
    ----------
    channels : list of int
        Channel id of each message.
    payloads : list of bytes
        Body of each message, in the order written.
    sequences : list of int
        Number of each message among all that were written; a gap is a loss.
    times_ns : list of int
        Time of each message [ns].
    headers : tuple of dict
        What may be the file's header, the better kept copy first.
    damage : JournalDamage
        What is missing.
    """

    channels: list[int]
    payloads: list[bytes]
    sequences: list[int]
    times_ns: list[int]
    headers: tuple[dict[str, str], ...]
    damage: JournalDamage


def read_raw_journal(path: Path) -> RawJournal:
    """Read the messages of a file, whatever state it is in.

    Parameters
    ----------
    path : Path
        The `.mcap` file; it is not changed.

    Raises
    ------
    RecordingError
        The file cannot be read, or its messages are in no order.
    """
    try:
        # A mapped file on a failing disk would end the program by SIGBUS.
        data = read_file(path, MAX_FILE_BYTES)
        if not data:
            raise RecordingError(f"{path}: the file is empty")
        return _read(data)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from error
    except RecordingError as error:
        text = str(error)
        raise RecordingError(text if text.startswith(str(path)) else f"{path}: {text}") from error


def messages_written(path: Path) -> int | None:
    """Return how many messages a closed file says that it holds; None where it does not say.

    Raises
    ------
    RecordingError
        The file cannot be read.
    """
    try:
        with path.open("rb") as file:
            size = file.seek(0, os.SEEK_END)
            file.seek(max(0, size - _TAIL_BYTES))
            start = _summary_start(file.read())
            if start is None or start >= size:
                return None
            file.seek(start)
            return _messages_written(file.read(), start)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from error


def _read(data: bytes) -> RawJournal:
    channels: list[int] = []
    payloads: list[bytes] = []
    sequences: list[int] = []
    times_ns: list[int] = []
    headers = [_metadata_pairs(data)]
    bad_chunks = end_of_chunks = 0
    for records, end_of_chunk in _chunks(data):
        if records is None:
            bad_chunks += 1
            continue
        end_of_chunks = end_of_chunk
        for opcode, start, end in _records(records):
            if opcode == _MESSAGE:
                channel, sequence, time_ns, _ = _MESSAGE_HEAD.unpack_from(records, start)
                if sequences and sequence <= sequences[-1]:
                    raise RecordingError(f"row {sequence} follows row {sequences[-1]}")
                sequences.append(sequence)
                times_ns.append(time_ns)
                channels.append(channel)
                payloads.append(records[start + _MESSAGE_HEAD.size : end])
            elif opcode == _CHANNEL and len(headers) == 1:
                headers.append(_channel_pairs(records[start:end]))
    total = _messages_written(data)
    damage = JournalDamage(
        finished=total is not None,
        gaps=_gaps(sequences, total),
        bad_chunks=bad_chunks,
        torn_bytes=len(data) - _end_of_index(data, end_of_chunks) if total is None else 0,
    )
    known = tuple(pairs for pairs in headers if pairs is not None)
    return RawJournal(channels, payloads, sequences, times_ns, known, damage)


def _end_of_index(data: bytes, position: int) -> int:
    """Return where the index records end that follow the last chunk."""
    while position + _RECORD.size <= len(data):
        opcode, length = _RECORD.unpack_from(data, position)
        if opcode != _MESSAGE_INDEX or position + _RECORD.size + length > len(data):
            break
        position += _RECORD.size + length
    return position


def _gaps(sequences: list[int], total: int | None) -> tuple[tuple[int, int], ...]:
    numbers = np.array([-1, *sequences, *([total] if total is not None else [])], dtype=np.int64)
    missing = np.diff(numbers) - 1
    return tuple((int(numbers[i]) + 1, int(missing[i])) for i in np.flatnonzero(missing > 0))


def _chunks(data: bytes) -> Iterator[tuple[bytes | None, int]]:
    """Yield every intact chunk's records and its end; None for one that fails its CRC."""
    position, size = 0, len(data)
    budget = 4 * size + MAX_CHUNK_BYTES
    while True:
        found = _MAYBE_CHUNK.search(data, position)
        if found is None or found.start() + _CHUNK.size > size:
            return
        start = found.start()
        _, length, _, _, plain_size, crc, _, stored_size = _CHUNK.unpack_from(data, start)
        begin = start + _CHUNK.size
        position = start + 1
        if not (plain_size == stored_size == length - (_CHUNK.size - _RECORD.size)):
            continue
        if stored_size > MAX_CHUNK_BYTES or begin + stored_size > size:
            continue
        budget -= stored_size
        if budget < 0:
            raise RecordingError("too damaged to read: more pieces of chunks than data")
        records = data[begin : begin + stored_size]
        if zlib.crc32(records) == crc:
            position = begin + stored_size
            yield records, position
        else:
            yield None, position


def _records(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, start and end of the body of every record."""
    position = 0
    while position < len(data):
        if position + _RECORD.size > len(data):
            raise RecordingError("a record is cut inside a chunk whose checksum is right")
        opcode, length = _RECORD.unpack_from(data, position)
        start = position + _RECORD.size
        position = start + length
        if position > len(data) or (opcode == _MESSAGE and length < _MESSAGE_HEAD.size):
            raise RecordingError("a record is cut inside a chunk whose checksum is right")
        yield opcode, start, position


def _pairs(data: bytes, position: int) -> dict[str, str] | None:
    """Read an MCAP map of strings; None where it is not one."""
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


def _metadata_pairs(data: bytes) -> dict[str, str] | None:
    """Return the metadata record near the file's start, None where it is damaged."""
    name = struct.pack("<I", len(METADATA_NAME)) + METADATA_NAME.encode()
    start = data.find(name, 0, 1 << 16)
    if start < 0:
        return None
    return _pairs(data[start : start + (1 << 16)], len(name))


def _channel_pairs(body: bytes) -> dict[str, str] | None:
    """Return the metadata of a channel record (id, schema id, topic, encoding, metadata)."""
    try:
        position = 4
        for _ in range(2):
            position += 4 + struct.unpack_from("<I", body, position)[0]
    except struct.error:
        return None
    return _pairs(body, position)


def _summary_start(tail: bytes) -> int | None:
    """Return where the summary of a finished file begins, by its last bytes; None without one."""
    if len(tail) < _TAIL_BYTES or tail[-len(_MAGIC) :] != _MAGIC:
        return None
    opcode, length = _RECORD.unpack_from(tail)
    start: int = _FOOTER_BODY.unpack_from(tail, _RECORD.size)[0]
    return start if opcode == _FOOTER and length == _FOOTER_BODY.size and start > 0 else None


def _messages_written(data: bytes, origin: int = 0) -> int | None:
    """Return the count of messages in the summary of a finished file, None where it has none.

    `data` are the file's bytes from `origin` on.
    """
    tail = len(data) - _TAIL_BYTES
    begin = _summary_start(data[max(tail, 0) :])
    if begin is None or not 0 <= begin - origin <= tail:
        return None
    crc = _FOOTER_BODY.unpack_from(data, tail + _RECORD.size)[2]
    if zlib.crc32(data[begin - origin : tail + _RECORD.size + 16]) != crc:
        return None
    summary = data[begin - origin : tail]
    for opcode, start, end in _records(summary):
        if opcode == _STATISTICS and end - start >= 8:
            return int(struct.unpack_from("<Q", summary, start)[0])
    return None
