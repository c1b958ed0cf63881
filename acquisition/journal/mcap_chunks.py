"""`keep_as_bytes`, `add_messages`: functions that the writer of the MCAP library lacks.

- `keep_as_bytes` limits the memory of the writer's index.
- `add_messages` adds many messages of equal size at once; the file is the same.

This is the only place that depends on internal names of the library mcap. The library's writer
keeps one Python object per chunk for the final summary. These objects need ten times as much memory
as the bytes that are finally written. `tests/acquisition/journal/test_mcap_chunks.py` fails if the
library changes these names.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import ChunkIndex, MessageIndex
from mcap.writer import Writer
from numpy.typing import NDArray

from acquisition.journal.mcap_records import MESSAGE, RECORD
from config.errors import RecordingError

ATTRIBUTE: Final = "_Writer__chunk_indices"
_BUILDER: Final = "_Writer__chunk_builder"
_CHUNK_SIZE: Final = "_Writer__chunk_size"
_STATISTICS: Final = "_Writer__statistics"


class ChunkIndices:
    """Index of all chunks, kept as the bytes that the writer finally writes."""

    def __init__(self) -> None:
        self._records = RecordBuilder()

    def append(self, index: ChunkIndex) -> None:
        """Add the index of a written chunk."""
        index.write(self._records)

    def __iter__(self) -> Iterator[ChunkIndices]:
        """Yield this object once; the writer then calls `write` once for all chunks."""
        yield self

    def write(self, summary: RecordBuilder) -> None:
        """Write the records of all chunks."""
        summary.write(self._records.end())  # type: ignore[no-untyped-call]


def keep_as_bytes(writer: Writer) -> None:
    """Make a new writer keep its chunk index as bytes.

    Raises:
        RecordingError: The writer of the installed library has other attributes.
    """
    names = {_BUILDER, _CHUNK_SIZE, _STATISTICS}
    if vars(writer).get(ATTRIBUTE) != [] or not names <= vars(writer).keys():
        raise RecordingError(
            "this version of the Python package mcap is not supported: install the version in"
            " uv.lock",
            code="RID-INSTALL-MCAP",
        )
    vars(writer)[ATTRIBUTE] = ChunkIndices()


class _MessageIndex:
    """Index of the messages of a chunk, instead of the library's list of pairs."""

    def __init__(self, channel: int, pairs: bytes) -> None:
        self._channel, self._pairs = channel, pairs

    def write(self, stream: RecordBuilder) -> None:
        stream.start_record(Opcode.MESSAGE_INDEX)
        stream.write2(self._channel)
        stream.write4(len(self._pairs))
        stream.write(self._pairs)
        stream.finish_record()  # type: ignore[no-untyped-call]


def add_messages(
    writer: Writer,
    channel: int,
    times_ns: NDArray[np.uint64],
    payloads: NDArray[np.uint8],
    sequence: int,
) -> None:
    """Write messages of equal size; the file is the same as after `add_message` for each message.

    Args:
        writer: The writer, without compression.
        channel: Channel of all messages.
        times_ns: Shape (messages,). Times [ns].
        payloads: Shape (messages, bytes). Bodies with encapsulation header.
        sequence: Number of the first message; the others are counted from it.
    """
    records = np.empty(len(payloads), _record_dtype(payloads.shape[1]))
    records["opcode"], records["length"] = MESSAGE, records.itemsize - RECORD.size
    records["channel"] = channel
    records["sequence"] = np.arange(sequence, sequence + len(records))
    records["log"] = records["publish"] = times_ns
    records["payload"] = payloads
    builder, chunk_bytes = vars(writer)[_BUILDER], vars(writer)[_CHUNK_SIZE]
    count, first = chunk_bytes // records.itemsize + 1, 0
    while first < len(records):
        room = (chunk_bytes - builder.count) // records.itemsize
        if not builder.count and len(records) - first >= count:
            part = records[first : first + count]
            _add_chunk(writer, channel, part)
        elif room > 0:
            part = records[first : first + room]
            _extend_chunk(writer, channel, part)
        else:
            part = records[first : first + 1]  # the library completes the chunk
            time_ns = int(part["log"][0])
            body, number = part["payload"][0].tobytes(), sequence + first
            writer.add_message(channel, time_ns, body, time_ns, number)
        first += len(part)


def _record_dtype(payload_bytes: int) -> np.dtype[Any]:
    """Return the numpy record type of a message record."""
    return np.dtype(
        [
            *(("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4")),
            *(("log", "<u8"), ("publish", "<u8"), ("payload", "u1", (payload_bytes,))),
        ]
    )


def _add_chunk(writer: Writer, channel: int, records: NDArray[Any]) -> None:
    """Write message records as one chunk; the writer must not have begun a chunk."""
    builder = vars(writer)[_BUILDER]
    pairs = np.empty((len(records), 2), "<u8")
    pairs[:, 0], pairs[:, 1] = records["log"], np.arange(len(records)) * records.itemsize
    builder.message_indices[channel] = _MessageIndex(channel, pairs.tobytes())
    _add_records(writer, channel, records)
    writer.flush()  # type: ignore[no-untyped-call]


def _extend_chunk(writer: Writer, channel: int, records: NDArray[Any]) -> None:
    """Add message records to the present chunk; they must not fill it."""
    builder = vars(writer)[_BUILDER]
    offsets = builder.count + np.arange(len(records)) * records.itemsize
    index = builder.message_indices.setdefault(channel, MessageIndex(channel, []))
    index.records.extend(zip(records["log"].tolist(), offsets.tolist(), strict=True))
    _add_records(writer, channel, records)


def _add_records(writer: Writer, channel: int, records: NDArray[Any]) -> None:
    """Add message records to the present chunk and the statistics, but not to its index."""
    builder, statistics = vars(writer)[_BUILDER], vars(writer)[_STATISTICS]
    start, end = int(records["log"].min()), int(records["log"].max())
    earlier = min(start, builder.message_start_time) if builder.num_messages else start
    builder.record_writer.write(records.tobytes())
    builder.message_start_time = earlier
    builder.message_end_time = max(end, builder.message_end_time)
    builder.num_messages += len(records)
    if statistics.message_count:
        start = min(start, statistics.message_start_time)
    statistics.message_start_time = start
    statistics.message_end_time = max(end, statistics.message_end_time)
    statistics.channel_message_counts[channel] += len(records)
    statistics.message_count += len(records)
