"""`JournalFile`: an MCAP file written in small pieces, so that a killed program loses little.

Messages are CDR (little endian) of one fixed size per channel; see decision 0004.
"""

from __future__ import annotations

import contextlib
import os
from io import FileIO
from pathlib import Path
from typing import IO, Any, Self, cast

import numpy as np
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray

from acquisition.journal.disk_reserve import FULL, DiskReserve
from acquisition.journal.mcap_chunks import add_messages, keep_as_bytes
from acquisition.journal.mcap_records import METADATA_NAME
from acquisition.journal.row_layout import CDR_LITTLE_ENDIAN
from config.arrays import FloatArray
from config.errors import RecordingError, system_errors
from config.process.file_locks import lock_holder
from config.process.linux import has_linux

CHUNK_BYTES = 8 * 1024  # size of a chunk: damage at one place loses at most one chunk
FLUSH_PERIOD_S = 0.08
LATEST_S = 1e10
MOST_LOST_S = 0.1  # most data that a killed recorder loses: one flush period and a delay
SYNC_PERIOD_S = 1.0
ROWS_AT_ONCE = 10_000


def open_new(path: Path) -> FileIO:
    """Open a new file without a buffer.

    Every write goes to the file's end. If another program truncates the file, it therefore stays
    shorter than the data written, and the loss can be detected.
    """
    return FileIO(path, "xb", opener=lambda name, flags: os.open(name, flags | os.O_APPEND, 0o666))


def is_being_written(path: Path) -> bool:
    """Return True if a recorder of this computer still has the journal open.

    The result is False if the file system does not support locks, and on other systems than Linux,
    which have no recorders.

    Raises:
        RecordingError: The file cannot be read.
    """
    with system_errors(RecordingError, f"{path}: cannot be read", code="RID-FILE-READ"):
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        return has_linux() and lock_holder(descriptor) is not None
    finally:
        os.close(descriptor)


def _lock(file: FileIO) -> None:
    """Lock a journal while it is open, if the system and the file system support locks."""
    with contextlib.suppress(ImportError, OSError):
        import fcntl

        fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)


class _Unbuffered:
    """Unbuffered file for the MCAP writer: a full disk cannot hold back buffered data.

    On a full disk, the file continues once, in the reserved space, and sets `full`.
    """

    def __init__(self, file: FileIO, reserve: DiskReserve) -> None:
        self._file = file
        self._reserve = reserve
        self.full = False
        self.written = 0
        self.tell = file.tell

    def write(self, data: bytes) -> None:
        rest = memoryview(data)
        while rest:
            try:
                count = self._file.write(rest)
                self.written += count
                rest = rest[count:]
            except OSError as error:
                if error.errno not in FULL or not self._reserve.release():
                    raise
                self.full = True

    def flush(self) -> None:
        """Do nothing: there is no buffer."""


class JournalFile:
    """A new MCAP file, open for writing; a context manager.

    Args:
        path: The file; it must not exist.
        metadata: Header of the file.
        reserve_bytes: Disk space to reserve, so that the file can be finished on a full disk.

    Attributes:
        path: The file.
        rows: Number of messages written so far, of all channels; it is the sequence number of the
            next message.

    Raises:
        RecordingError: The file cannot be made or written (disk full, no permission, it exists).
    """

    def __init__(self, path: Path, metadata: dict[str, str], *, reserve_bytes: int = 0) -> None:
        self.path = path
        self.rows = 0
        try:
            self._file = open_new(path)
        except FileExistsError as error:
            raise RecordingError(
                f"{path}: exists already; recordings are never overwritten",
                code="RID-OUTPUT-EXISTS",
            ) from error
        except OSError as error:
            raise RecordingError(
                f"{path}: cannot create: {error.strerror}", code="RID-FILE-WRITE"
            ) from error
        _lock(self._file)
        try:
            self._reserve = DiskReserve(path.parent, reserve_bytes)
        except RecordingError:
            self._file.close()
            path.unlink()
            raise
        self._output = _Unbuffered(self._file, self._reserve)
        self._writer = Writer(
            cast(IO[bytes], self._output),
            chunk_size=CHUNK_BYTES,
            compression=CompressionType.NONE,
            enable_crcs=True,
        )
        keep_as_bytes(self._writer)
        self._writer.start(profile="ros2", library="rid-daq")
        self._writer.add_metadata(METADATA_NAME, metadata)

    @property
    def disk_full(self) -> bool:
        """True if the disk is full and the file uses the reserved space."""
        return self._output.full

    @property
    def trouble(self) -> str:
        """Problem of the open file, as a part of a sentence; empty for an undamaged file.

        If this property is read at every flush, a deleted file is noticed within `MOST_LOST_S`.
        """
        try:
            opened, size = os.fstat(self._file.fileno()), self._output.written
            if opened.st_nlink == 0:
                return "was deleted while it was being written"
            if opened.st_size < size:
                return f"was cut while it was being written: {size - opened.st_size} bytes are gone"
            at_path = os.stat(self.path, follow_symlinks=False)
        except FileNotFoundError:
            return "was moved away while it was being written"
        except OSError as error:
            return f"cannot be examined: {error.strerror}"
        if (at_path.st_dev, at_path.st_ino) != (opened.st_dev, opened.st_ino):
            return "was replaced by another file while it was being written"
        return ""

    def add_channel(
        self, topic: str, message_name: str, definition: str, metadata: dict[str, str]
    ) -> int:
        """Add a channel for messages of a ROS 2 definition; return the channel's id."""
        schema = self._writer.register_schema(message_name, "ros2msg", definition.encode())
        return self._writer.register_channel(topic, "cdr", schema, metadata)

    def add_message(self, channel: int, time_s: float, body: bytes) -> None:
        """Write one message with a given CDR body; an invalid time becomes 0."""
        time_ns = round(time_s * 1e9) if 0.0 <= time_s < LATEST_S else 0
        self._add(channel, time_ns, CDR_LITTLE_ENDIAN + body)

    def add_messages(self, channel: int, time_s: FloatArray, rows: NDArray[Any]) -> None:
        """Write many messages; the file is the same as after `add_message` for each message.

        Args:
            channel: Channel of all messages.
            time_s: Shape (messages,). Times [s]; an invalid time becomes 0.
            rows: Shape (messages,). Records without padding, the CDR bodies.
        """
        for first in range(0, len(rows), ROWS_AT_ONCE):
            part, at_s = rows[first : first + ROWS_AT_ONCE], time_s[first : first + ROWS_AT_ONCE]
            valid = (at_s >= 0.0) & (at_s < LATEST_S)
            times_ns = np.rint(np.where(valid, at_s, 0.0) * 1e9).astype(np.uint64)
            payloads = np.empty((len(part), len(CDR_LITTLE_ENDIAN) + part.itemsize), np.uint8)
            payloads[:, : len(CDR_LITTLE_ENDIAN)] = list(CDR_LITTLE_ENDIAN)
            bodies = np.frombuffer(part.tobytes(), np.uint8)
            payloads[:, len(CDR_LITTLE_ENDIAN) :] = bodies.reshape(len(part), -1)
            try:
                add_messages(self._writer, channel, times_ns, payloads, self.rows)
            except OSError as error:
                raise self._write_error(error) from error
            self.rows += len(part)

    def copy_message(self, channel: int, time_ns: int, payload: bytes, sequence: int) -> None:
        """Copy a message of another journal with its sequence number.

        The numbers must increase. Readers report omitted numbers as lost messages.
        """
        self.rows = sequence
        self._add(channel, time_ns, payload)

    def _add(self, channel: int, time_ns: int, payload: bytes) -> None:
        try:
            self._writer.add_message(channel, time_ns, payload, time_ns, self.rows)
        except OSError as error:
            raise self._write_error(error) from error
        self.rows += 1

    def flush(self, *, to_disk: bool = False) -> None:
        """Pass all data to the operating system; with `to_disk`, wait until it is on the disk."""
        try:
            self._writer.flush()  # type: ignore[no-untyped-call]
            if to_disk:
                os.fsync(self._file.fileno())
        except OSError as error:
            raise self._write_error(error) from error

    def close(self) -> None:
        """Write the summary and close the file."""
        if self._file.closed:
            return
        try:
            self._writer.finish()  # type: ignore[no-untyped-call]
            os.fsync(self._file.fileno())
            self._file.close()
        except OSError as error:
            raise self._write_error(error) from error
        finally:
            self._reserve.release()

    def abandon(self) -> None:
        """Close the file without a summary; it stays readable."""
        self._reserve.release()
        self._file.close()

    def _write_error(self, error: OSError) -> RecordingError:
        return RecordingError(
            f"{self.path}: cannot be written: {error.strerror}; the data flushed before is kept",
            code="RID-RECORDING-LOST",
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.close()
        else:
            self.abandon()
