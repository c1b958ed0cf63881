"""`JournalReader`: messages of an MCAP file, complete, unfinished, torn or damaged.

- A chunk is accepted at any position in the file if its frame is consistent and its CRC correct.
  Its bytes are then those that were written.
- Missing messages are found by their sequence numbers and, in a finished file, by the count in its
  summary.
- The lengths of records are not trusted. Therefore a single damaged length cannot hide the rest of
  the file.
"""

from __future__ import annotations

import contextlib
import os
import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from acquisition.journal.mcap_records import (
    CHANNEL,
    HEAD_BYTES,
    MESSAGE,
    MESSAGE_HEAD,
    MESSAGE_INDEX,
    RECORD,
    channel_pairs,
    count_written,
    metadata_pairs,
    records_of,
)
from config.errors import RecordingError, system_errors
from config.formats.bounded_file import open_file

PIECE_BYTES = 1 << 18
MAX_CHUNK_BYTES = 1 << 20
MAX_FILE_BYTES = 4_000_000_000
_CHUNK = struct.Struct("<BQQQQIIQ")
"""Head of a chunk: opcode, record length, first and last time, uncompressed size, CRC, length of
the (empty) name of the compression, size of the records."""
_MAYBE_CHUNK = re.compile(rb"\x06(?=.{4}\0{4}.{16}.{4}\0{4}.{4}\0{4}.{4}\0{4})", re.DOTALL)


@dataclass(frozen=True)
class JournalDamage:
    """Missing data of a journal.

    Attributes:
        finished: True if the recorder closed the file. Otherwise rows after the last one may be
            missing.
        gaps: For each gap, the first missing row (from 0) and the number of missing rows.
        bad_chunks: Number of chunks with a wrong CRC.
        torn_bytes: Bytes after the last readable chunk of an unclosed file.
    """

    finished: bool
    gaps: tuple[tuple[int, int], ...]
    bad_chunks: int
    torn_bytes: int = 0

    @property
    def rows_lost(self) -> int:
        """Number of rows known to be missing."""
        return sum(count for _, count in self.gaps)

    @property
    def notes(self) -> tuple[str, ...]:
        """The damage, one sentence each; empty for a sound file."""
        notes = [
            f"rows {first} to {first + count - 1} are lost ({count} rows)"
            for first, count in self.gaps
        ]
        if self.bad_chunks:
            notes.append(f"{self.bad_chunks} blocks fail their checksum and were left out")
        if self.torn_bytes:
            notes.append(f"the last {self.torn_bytes} bytes are incomplete and were left out")
        if not self.finished:
            notes.append("the file was not closed: rows after the last one may be missing")
        return tuple(notes)


@dataclass(frozen=True, eq=False)
class Messages:
    """Messages of a file with correct checksums, in the order written.

    Attributes:
        channels: Channel id of each message.
        payloads: Body of each message.
        sequences: Sequence number of each message; a gap is a loss.
        times_ns: Time of each message [ns].
    """

    channels: list[int] = field(default_factory=list)
    payloads: list[bytes] = field(default_factory=list)
    sequences: list[int] = field(default_factory=list)
    times_ns: list[int] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class RawJournal(Messages):
    """All messages of a file.

    Attributes:
        headers: Copies of the header, which may be damaged.
        damage: Missing data.
    """

    headers: tuple[dict[str, str], ...] = ()
    damage: JournalDamage = field(default_factory=lambda: JournalDamage(False, (), 0))


class JournalReader:
    """Incremental reader of a file, which may still be written; a context manager.

    Args:
        path: The `.mcap` file, complete or not; it is not changed.

    Raises:
        RecordingError: The file cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._stack = contextlib.ExitStack()
        self._head = b""
        self._data = b""  # data read so far, beyond the last complete chunk
        self._origin = 0  # position of `_data` in the file
        self._spent = 0
        self._channel_pairs: dict[str, str] | None = None
        self._gaps: list[tuple[int, int]] = []
        self._next = 0
        self._bad_chunks = self._end_of_chunks = 0
        with self._name_the_file():
            self._file = self._stack.enter_context(open_file(path, MAX_FILE_BYTES))

    def __enter__(self) -> JournalReader:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    @property
    def headers(self) -> tuple[dict[str, str], ...]:
        """Copies of the header in the data read so far: of the file, then of its first channel."""
        candidates = (metadata_pairs(self._head), self._channel_pairs)
        return tuple(pairs for pairs in candidates if pairs is not None)

    def pieces(self, *, growing: bool = False) -> Iterator[Messages]:
        """Yield the new messages up to the file's present end, after each quarter MB that is read.

        Args:
            growing: True if an incomplete end may still be completed.

        Raises:
            RecordingError: The file cannot be read, or its messages are not in order.
        """
        with self._name_the_file():
            at_end = False
            while not at_end:
                # Not memory-mapped: a failing disk would then end the program with SIGBUS.
                more = self._file.read(PIECE_BYTES)
                if not (more or self._origin or self._data or growing):
                    raise RecordingError("the file is empty", code="RID-RECORDING-DAMAGED")
                at_end = self._file.tell() >= self._size or not more
                if len(self._head) < 2 * HEAD_BYTES:
                    self._head += more[: 2 * HEAD_BYTES - len(self._head)]
                self._data += more
                messages = self._messages(last=at_end and not growing)
                if messages.payloads:
                    yield messages

    def damage(self) -> JournalDamage:
        """Return the missing data of a file that was read to its end and is no longer written.

        Raises:
            RecordingError: The file cannot be read.
        """
        with self._name_the_file():
            total = count_written(self._file)
            gaps = list(self._gaps)
            if total is not None and total > self._next:
                gaps.append((self._next, total - self._next))
            return JournalDamage(
                finished=total is not None,
                gaps=tuple(gaps),
                bad_chunks=self._bad_chunks,
                torn_bytes=self._size - self._end_of_index() if total is None else 0,
            )

    @property
    def _size(self) -> int:
        return os.fstat(self._file.fileno()).st_size

    @contextlib.contextmanager
    def _name_the_file(self) -> Iterator[None]:
        """Add the name of the file to an error."""
        try:
            yield
        except OSError as error:
            raise RecordingError(
                f"{self._path}: cannot be read: {error.strerror}", code="RID-FILE-READ"
            ) from error
        except RecordingError as error:
            text = str(error)
            named = text if text.startswith(str(self._path)) else f"{self._path}: {text}"
            raise RecordingError(named, code=error.refusal) from error

    def _messages(self, last: bool) -> Messages:
        """Return the messages of all complete chunks."""
        messages = Messages()
        for records in self._chunks(last):
            if records is None:
                self._bad_chunks += 1
                continue
            for opcode, start, end in records_of(records):
                if opcode == MESSAGE:
                    channel, sequence, time_ns, _ = MESSAGE_HEAD.unpack_from(records, start)
                    if sequence < self._next:
                        raise RecordingError(
                            f"row {sequence} comes after row {self._next - 1}: rows are"
                            " repeated or out of order",
                            code="RID-RECORDING-DAMAGED",
                        )
                    if sequence > self._next:
                        self._gaps.append((self._next, sequence - self._next))
                    self._next = sequence + 1
                    messages.sequences.append(sequence)
                    messages.times_ns.append(time_ns)
                    messages.channels.append(channel)
                    messages.payloads.append(records[start + MESSAGE_HEAD.size : end])
                elif opcode == CHANNEL and self._channel_pairs is None:
                    self._channel_pairs = channel_pairs(records[start:end])
        return messages

    def _chunks(self, last: bool) -> Iterator[bytes | None]:
        """Yield the records of every intact chunk; None for a chunk with a wrong CRC.

        A possible chunk that extends beyond the data read is kept until the `last` data has
        arrived.
        """
        data, size = self._data, self._size
        position = 0
        while True:
            found = _MAYBE_CHUNK.search(data, position)
            if found is None:
                position = max(position, len(data) - _CHUNK.size + 1)
                break
            start = found.start()
            _, length, _, _, plain_size, crc, _, stored_size = _CHUNK.unpack_from(data, start)
            begin = start + _CHUNK.size
            position = start + 1
            if not (plain_size == stored_size == length - (_CHUNK.size - RECORD.size)):
                continue
            if stored_size > MAX_CHUNK_BYTES:
                continue
            if begin + stored_size > len(data):
                if last:
                    continue
                position = start
                break
            self._spent += stored_size
            if self._spent > 4 * size + MAX_CHUNK_BYTES:
                raise RecordingError(
                    "too damaged to read: the heads of chunks announce more data than the file has",
                    code="RID-RECORDING-DAMAGED",
                )
            records = data[begin : begin + stored_size]
            if zlib.crc32(records) != crc:
                yield None
                continue
            position = begin + stored_size
            self._end_of_chunks = self._origin + position
            yield records
        self._data = data[position:]
        self._origin += position

    def _end_of_index(self) -> int:
        """Return the end of the index records after the last chunk."""
        descriptor, position, size = self._file.fileno(), self._end_of_chunks, self._size
        while position + RECORD.size <= size:
            opcode, length = RECORD.unpack(os.pread(descriptor, RECORD.size, position))
            if opcode != MESSAGE_INDEX or position + RECORD.size + length > size:
                break
            position += RECORD.size + length
        return position


def read_raw_journal(path: Path) -> RawJournal:
    """Read the messages of a file, complete or damaged.

    Args:
        path: The `.mcap` file; it is not changed.

    Raises:
        RecordingError: The file cannot be read, or its messages are not in order.
    """
    whole = Messages()
    with JournalReader(path) as reader:
        for piece in reader.pieces():
            whole.channels.extend(piece.channels)
            whole.payloads.extend(piece.payloads)
            whole.sequences.extend(piece.sequences)
            whole.times_ns.extend(piece.times_ns)
        return RawJournal(
            whole.channels,
            whole.payloads,
            whole.sequences,
            whole.times_ns,
            reader.headers,
            reader.damage(),
        )


def messages_written(path: Path) -> int | None:
    """Return the number of messages in the summary of a closed file; None without a summary.

    Raises:
        RecordingError: The file cannot be read.
    """
    with (
        system_errors(RecordingError, f"{path}: cannot be read", code="RID-FILE-READ"),
        open_file(path, MAX_FILE_BYTES) as file,
    ):
        return count_written(file)
