"""`keep_as_bytes`: limits the memory of the MCAP writer's index, as the library cannot.

This is the only place that depends on internal names of the library mcap. Its writer keeps one
object per chunk for the final summary, which takes ten times the memory of the written bytes.
`tests/acquisition/journal/test_mcap_chunks.py` fails if the library changes these names.
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
    """List of chunks in the form of the bytes that the writer finally writes."""

    def __init__(self) -> None:
        self._records = RecordBuilder()

    def append(self, index: ChunkIndex) -> None:
        """Add the index of a written chunk."""
        index.write(self._records)

    def __iter__(self) -> Iterator[ChunkIndices]:
        """Yield itself, the one entry of the list."""
        yield self

    def write(self, summary: RecordBuilder) -> None:
        """Write the records of all chunks."""
        summary.write(self._records.end())  # type: ignore[no-untyped-call]


def keep_as_bytes(writer: Writer) -> None:
    """Make a new writer keep its chunk index as bytes.

    Raises:
        RecordingError: The library's writer has no such list.
    """
    if vars(writer).get(ATTRIBUTE) != []:
        raise RecordingError(
            "this version of the Python package mcap is not supported: install the version in"
            " uv.lock",
            code="RID-INSTALL-MCAP",
        )
    vars(writer)[ATTRIBUTE] = ChunkIndices()
