"""`JournalFile`: an MCAP file written in small pieces, so that a killed program loses little.

Messages are CDR (little endian) of one fixed size a channel; see docs/decisions/0004.
"""

from __future__ import annotations

import os
from io import FileIO
from pathlib import Path
from types import TracebackType
from typing import IO, Self, cast

from mcap.writer import CompressionType, Writer

from acquisition.cycle_row import CDR_LITTLE_ENDIAN
from acquisition.journal_chunks import METADATA_NAME
from config.errors import RecordingError

CHUNK_BYTES = 64 * 1024
FLUSH_PERIOD_S = 0.1
SYNC_PERIOD_S = 1.0


class _Unbuffered:
    """What the MCAP writer needs of a file, without a buffer that a full disk would keep back."""

    def __init__(self, file: FileIO) -> None:
        self._file = file
        self.tell = file.tell

    def write(self, data: bytes) -> None:
        rest = memoryview(data)
        while rest:
            rest = rest[self._file.write(rest) :]

    def flush(self) -> None:
        """Nothing is held back."""


class JournalFile:
    """A new MCAP file, open for writing; a context manager.

    Parameters
    ----------
    path : Path
        The file; it must not exist.
    metadata : dict of str
        What the file says about itself.

    Attributes
    ----------
    rows : int
        Messages written so far, of all channels; each carries its number.

    Raises
    ------
    RecordingError
        The file cannot be made or written (disk full, no permission, it exists).
    """

    def __init__(self, path: Path, metadata: dict[str, str]) -> None:
        self._path = path
        self.rows = 0
        try:
            self._file = path.open("xb", buffering=0)
        except FileExistsError as error:
            raise RecordingError(
                f"{path}: exists already; a recording is never replaced"
            ) from error
        except OSError as error:
            raise RecordingError(f"{path}: cannot be made: {error.strerror}") from error
        self._writer = Writer(
            cast(IO[bytes], _Unbuffered(self._file)),
            chunk_size=CHUNK_BYTES,
            compression=CompressionType.NONE,
            enable_crcs=True,
        )
        self._writer.start(profile="ros2", library="rid-daq")
        self._writer.add_metadata(METADATA_NAME, metadata)

    def add_channel(
        self, topic: str, message_name: str, definition: str, metadata: dict[str, str]
    ) -> int:
        """Announce messages of a new kind, by their ROS 2 definition; return their channel."""
        schema = self._writer.register_schema(message_name, "ros2msg", definition.encode())
        return self._writer.register_channel(topic, "cdr", schema, metadata)

    def add_message(self, channel: int, time_s: float, body: bytes) -> None:
        """Write one message, its CDR body given."""
        time_ns = max(round(time_s * 1e9), 0)
        try:
            self._writer.add_message(channel, time_ns, CDR_LITTLE_ENDIAN + body, time_ns, self.rows)
        except OSError as error:
            raise self._lost(error) from error
        self.rows += 1

    def flush(self, *, to_disk: bool = False) -> None:
        """Hand everything to the operating system; with `to_disk` wait until it is on the disk."""
        try:
            self._writer.flush()  # type: ignore[no-untyped-call]
            if to_disk:
                os.fsync(self._file.fileno())
        except OSError as error:
            raise self._lost(error) from error

    def close(self) -> None:
        """Write the summary and close the file."""
        if self._file.closed:
            return
        try:
            self._writer.finish()  # type: ignore[no-untyped-call]
            os.fsync(self._file.fileno())
            self._file.close()
        except OSError as error:
            raise self._lost(error) from error

    def abandon(self) -> None:
        """Leave the file as far as it got: unfinished, but readable."""
        self._file.close()

    def _lost(self, error: OSError) -> RecordingError:
        return RecordingError(
            f"{self._path}: cannot be written: {error.strerror}; what was flushed before is kept"
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self.close()
        else:
            self.abandon()
