"""The chunk index of an MCAP file is kept as bytes: the file is the same, and memory is saved."""

from __future__ import annotations

import io
import tracemalloc

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from acquisition.journal.mcap_chunks import ATTRIBUTE, add_messages, keep_as_bytes
from config.errors import RecordingError

CHUNKS = 400


def write_chunks(output: io.BytesIO, *, as_bytes: bool) -> int:
    """Write a file of many chunks and return the memory that the writer keeps [bytes]."""
    writer = Writer(output, chunk_size=64, compression=CompressionType.NONE)
    if as_bytes:
        keep_as_bytes(writer)
    writer.start(profile="ros2", library="test")
    schema = writer.register_schema("rows", "ros2msg", b"uint8[64] data")
    channel = writer.register_channel("/rows", "cdr", schema)
    tracemalloc.start()
    room = output.tell()
    for number in range(CHUNKS):
        writer.add_message(channel, number, bytes(64), number, number)
        output.seek(room)  # overwrite the last chunk, so that the file needs no memory
    held = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    return held


def complete_file(*, as_bytes: bool) -> bytes:
    output = io.BytesIO()
    writer = Writer(output, chunk_size=64, compression=CompressionType.NONE)
    if as_bytes:
        keep_as_bytes(writer)
    writer.start(profile="ros2", library="test")
    schema = writer.register_schema("rows", "ros2msg", b"uint8[64] data")
    channel = writer.register_channel("/rows", "cdr", schema)
    for number in range(CHUNKS):
        writer.add_message(channel, number, bytes(64), number, number)
    writer.finish()
    return output.getvalue()


def test_the_file_is_identical_to_that_of_the_library() -> None:
    assert complete_file(as_bytes=True) == complete_file(as_bytes=False)
    summary = make_reader(io.BytesIO(complete_file(as_bytes=True))).get_summary()
    assert summary is not None
    assert len(summary.chunk_indexes) >= CHUNKS


@pytest.mark.parametrize("batches", [(1, 2, 16), (5, 100, 3, 40), (200,), (15, 16, 15, 16, 31)])
def test_messages_that_are_added_together_give_the_file_of_single_ones(
    batches: tuple[int, ...],
) -> None:
    files = []
    for together in (True, False):
        output, number = io.BytesIO(), 0
        writer = Writer(output, chunk_size=1500, compression=CompressionType.NONE)
        keep_as_bytes(writer)
        writer.start(profile="ros2", library="test")
        schema = writer.register_schema("rows", "ros2msg", b"uint8[64] data")
        rows, events = (writer.register_channel(f"/{name}", "cdr", schema) for name in "ab")
        for size in batches:
            times_ns = (np.arange(number, number + size, dtype=np.uint64) * 7919) % 1000
            payloads = np.arange(64 * size, dtype=np.uint64).astype(np.uint8).reshape(size, 64)
            if together:
                add_messages(writer, rows, times_ns, payloads, number)
            else:
                for i, time_ns in enumerate(times_ns.tolist()):
                    body = payloads[i].tobytes()
                    writer.add_message(rows, time_ns, body, time_ns, number + i)
            number += size
            writer.add_message(events, number, bytes(64), number, number)
        writer.finish()
        files.append(output.getvalue())
    assert files[0] == files[1]


def test_the_library_still_needs_more_memory() -> None:
    """If this test fails, the mcap library limits the memory of its index itself: then delete
    `mcap_chunks.py`.
    """
    assert write_chunks(io.BytesIO(), as_bytes=False) > 3 * write_chunks(
        io.BytesIO(), as_bytes=True
    )


def test_a_writer_without_an_index_list_is_refused() -> None:
    writer = Writer(io.BytesIO())
    del vars(writer)[ATTRIBUTE]
    with pytest.raises(RecordingError) as refused:
        keep_as_bytes(writer)
    assert refused.value.refusal == "RID-INSTALL-MCAP"
