"""`JournalFile`: an MCAP file written in small pieces, so that a killed program loses little.

Messages are CDR (little endian) of one fixed size a channel; see docs/decisions/0004.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
from io import FileIO
from pathlib import Path
from typing import IO, Self, cast

from mcap.writer import CompressionType, Writer

from acquisition.journal.disk_reserve import FULL, DiskReserve
from acquisition.journal.mcap_chunks import keep_as_bytes
from acquisition.journal.mcap_records import METADATA_NAME
from acquisition.journal.row_layout import CDR_LITTLE_ENDIAN
from config.errors import RecordingError, system_errors
from config.process.file_locks import lock_holder

CHUNK_BYTES = 8 * 1024  # what a single damage costs at most
FLUSH_PERIOD_S = 0.08
LATEST_S = 1e10
MOST_LOST_S = 0.1  # by a recorder that is killed: a flush, and its way there
SYNC_PERIOD_S = 1.0


def open_new(path: Path) -> FileIO:
    """Open a file that must not exist, without a buffer.

    Every write goes to its end: a file that somebody cuts stays shorter than what was written.
    """
    return FileIO(path, "xb", opener=lambda name, flags: os.open(name, flags | os.O_APPEND, 0o666))


def being_written(path: Path) -> bool:
    """Return whether a recorder of this computer still has the journal open.

    Raises:
        RecordingError: The file cannot be read.
    """
    with system_errors(RecordingError, f"{path}: cannot be read", code="RID-FILE-READ"):
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        return lock_holder(descriptor) is not None
    finally:
        os.close(descriptor)


class _Unbuffered:
    """What the MCAP writer needs of a file, without a buffer that a full disk would keep back.

    On a full disk it goes on in the room that was kept free, once, and says that it is `full`.
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
        """Nothing is held back."""


class JournalFile:
    """A new MCAP file, open for writing; a context manager.

    Args:
        path: The file; it must not exist.
        metadata: What the file says about itself.
        reserve_bytes: Room kept free on the disk, so that a file can be finished when the disk is
            full.

    Attributes:
        path: The file.
        rows: Messages written so far, of all channels; each carries its number.

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
                f"{path}: exists already; a recording is never replaced",
                code="RID-OUTPUT-EXISTS",
            ) from error
        except OSError as error:
            raise RecordingError(
                f"{path}: cannot be made: {error.strerror}", code="RID-FILE-WRITE"
            ) from error
        with contextlib.suppress(OSError):  # a file system without locks
            fcntl.flock(self._file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
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
        """Whether the disk is full, and the file goes on in the room kept free for its end."""
        return self._output.full

    @property
    def trouble(self) -> str:
        """What became of the file while it is written, as a clause; empty as long as it is whole.

        Asked for every flush, a deleted file is noticed within `MOST_LOST_S` of the time of day.
        """
        try:
            own, size = os.fstat(self._file.fileno()), self._output.written
            if own.st_nlink == 0:
                return "was deleted while it was being written"
            if own.st_size < size:
                return f"was cut while it was being written: {size - own.st_size} bytes are gone"
            there = os.stat(self.path, follow_symlinks=False)
        except FileNotFoundError:
            return "was moved away while it was being written"
        except OSError as error:
            return f"cannot be looked at: {error.strerror}"
        if (there.st_dev, there.st_ino) != (own.st_dev, own.st_ino):
            return "was replaced by another file while it was being written"
        return ""

    def add_channel(
        self, topic: str, message_name: str, definition: str, metadata: dict[str, str]
    ) -> int:
        """Announce messages of a new kind, by their ROS 2 definition; return their channel."""
        schema = self._writer.register_schema(message_name, "ros2msg", definition.encode())
        return self._writer.register_channel(topic, "cdr", schema, metadata)

    def add_message(self, channel: int, time_s: float, body: bytes) -> None:
        """Write one message, its CDR body given; a time that cannot be counts as 0."""
        time_ns = round(time_s * 1e9) if 0.0 <= time_s < LATEST_S else 0
        self._add(channel, time_ns, CDR_LITTLE_ENDIAN + body)

    def copy_message(self, channel: int, time_ns: int, payload: bytes, sequence: int) -> None:
        """Write a message of another journal as it was there, its number too.

        Numbers grow; those left out stay visible to every reader as lost.
        """
        self.rows = sequence
        self._add(channel, time_ns, payload)

    def _add(self, channel: int, time_ns: int, payload: bytes) -> None:
        try:
            self._writer.add_message(channel, time_ns, payload, time_ns, self.rows)
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
        finally:
            self._reserve.release()

    def abandon(self) -> None:
        """Leave the file as far as it got: unfinished, but readable."""
        self._reserve.release()
        self._file.close()

    def _lost(self, error: OSError) -> RecordingError:
        return RecordingError(
            f"{self.path}: cannot be written: {error.strerror}; what was flushed before is kept",
            code="RID-RECORDING-LOST",
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.close()
        else:
            self.abandon()
