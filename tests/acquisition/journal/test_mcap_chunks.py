"""The chunk index of an MCAP file is stored as bytes: the file is the same, and the memory hardly
grows.
"""

from __future__ import annotations

import io
import tracemalloc

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from acquisition.journal.mcap_chunks import ATTRIBUTE, keep_as_bytes
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
