"""`keep_as_bytes`: limits the memory of the MCAP writer's index, which the library cannot do.

This is the only place that depends on internal names of the library mcap. The library's writer
keeps one Python object per chunk for the final summary. These objects need ten times as much memory
as the bytes that are finally written. `tests/acquisition/journal/test_mcap_chunks.py` fails if the
library changes these names.
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
    """Index of all chunks, kept as the bytes that the writer finally writes."""

    def __init__(self) -> None:
        self._records = RecordBuilder()

    def append(self, index: ChunkIndex) -> None:
        """Add the index of a written chunk."""
        index.write(self._records)

    def __iter__(self) -> Iterator[ChunkIndices]:
        """Yield this object once, so that the writer calls `write` once for all chunks."""
        yield self

    def write(self, summary: RecordBuilder) -> None:
        """Write the records of all chunks."""
        summary.write(self._records.end())  # type: ignore[no-untyped-call]


def keep_as_bytes(writer: Writer) -> None:
    """Make a new writer keep its chunk index as bytes.

    Raises:
        RecordingError: The writer of the installed library has no such index.
    """
    if vars(writer).get(ATTRIBUTE) != []:
        raise RecordingError(
            "this version of the Python package mcap is not supported: install the version in"
            " uv.lock",
            code="RID-INSTALL-MCAP",
        )
    vars(writer)[ATTRIBUTE] = ChunkIndices()
