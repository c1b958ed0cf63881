"""`keep_as_bytes`: bounds the memory of the MCAP writer's index, which has no option for it.

The only place of this project that depends on names inside the library mcap. Its writer keeps one
object a chunk for the summary at the end, ten times the memory of the bytes that it writes of it.
`tests/acquisition/journal/test_mcap_chunks.py` fails if the library changes what is used here.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from mcap.data_stream import RecordBuilder
from mcap.records import ChunkIndex
from mcap.writer import Writer

from config.errors import RecordingError

ATTRIBUTE: Final = "_Writer__chunk_indices"


class ChunkIndices:
    """The writer's list of chunks, as the bytes that it writes in the end."""

    def __init__(self) -> None:
        self._records = RecordBuilder()

    def append(self, index: ChunkIndex) -> None:
        """Take the index of a chunk that was written."""
        index.write(self._records)

    def __iter__(self) -> Iterator[ChunkIndices]:
        """Yield itself, the one entry of the list."""
        yield self

    def write(self, summary: RecordBuilder) -> None:
        """Write the records of all chunks."""
        summary.write(self._records.end())  # type: ignore[no-untyped-call]


def keep_as_bytes(writer: Writer) -> None:
    """Let a new writer keep its index of chunks as bytes.

    Raises:
        RecordingError: The library's writer has no such list.
    """
    if vars(writer).get(ATTRIBUTE) != []:
        raise RecordingError(
            "this version of the Python package mcap is not supported: install the one that"
            " uv.lock names",
            code="RID-INSTALL-MCAP",
        )
    vars(writer)[ATTRIBUTE] = ChunkIndices()
