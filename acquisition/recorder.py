"""The recorder: a process of its own that carries rows from the ring into the journal.

It outlives the cyclic task and the program: a killed program costs nothing that the ring holds.
"""

from __future__ import annotations

import os
import struct
import time
from io import FileIO
from pathlib import Path
from types import TracebackType
from typing import IO, cast

from mcap.writer import CompressionType, Writer

from acquisition.control_block import ControlBlock, RecorderState
from acquisition.cycle_row import (
    CDR_LITTLE_ENDIAN,
    MESSAGE_NAME,
    message_definition,
    row_struct,
)
from acquisition.journal import METADATA_NAME
from acquisition.journal_header import JournalHeader
from acquisition.ring import Ring
from acquisition.termination import ignore_termination
from config.errors import RecordingError

TOPIC = "/cycle"
CHUNK_BYTES = 64 * 1024
FLUSH_PERIOD_S = 0.1
SYNC_PERIOD_S = 1.0
IDLE_S = 0.005
ORPHAN_PATIENCE_S = 5.0


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


class JournalWriter:
    """Writes rows to a new MCAP file; a context manager.

    Parameters
    ----------
    path : Path
        The file; it must not exist.
    header : JournalHeader
        What the recording says about itself.

    Raises
    ------
    RecordingError
        The file cannot be made or written (disk full, no permission, it exists).
    """

    def __init__(self, path: Path, header: JournalHeader) -> None:
        self._path = path
        joints = len(header.joint_names)
        self._row_size = row_struct(joints).size
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
        pairs = header.to_metadata()
        self._writer.add_metadata(METADATA_NAME, pairs)
        definition = message_definition(joints).encode()
        schema = self._writer.register_schema(MESSAGE_NAME, "ros2msg", definition)
        self._channel = self._writer.register_channel(TOPIC, "cdr", schema, pairs)

    def append(self, rows: bytes) -> None:
        """Write whole rows, as the ring gives them."""
        size, writer, channel = self._row_size, self._writer, self._channel
        try:
            for start in range(0, len(rows), size):
                time_s: float = struct.unpack_from("<d", rows, start)[0]
                time_ns = max(round(time_s * 1e9), 0)
                data = CDR_LITTLE_ENDIAN + rows[start : start + size]
                writer.add_message(channel, time_ns, data, time_ns, self.rows)
                self.rows += 1
        except OSError as error:
            raise self._lost(error) from error

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

    def __enter__(self) -> JournalWriter:
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


def run_recorder(
    ring: Ring, control: ControlBlock, path: Path, header: JournalHeader, parent: int
) -> None:
    """Run the recorder; the main function of its process.

    It ends when the task has ended and the ring is empty; after the program's death
    also when the task shows no sign of life for `ORPHAN_PATIENCE_S`.

    Parameters
    ----------
    ring : Ring
        Where the rows come from.
    control : ControlBlock
        Where it says how it fares, and learns that the task has ended.
    path : Path
        The journal to write.
    header : JournalHeader
        What the journal says about itself.
    parent : int
        Process id of the program.
    """
    ignore_termination()
    try:
        with JournalWriter(path, header) as writer:
            control.recorder_state = RecorderState.RECORDING
            _carry(ring, control, writer, parent)
        control.recorder_state = RecorderState.FINISHED
    except RecordingError as error:
        control.fail_recorder(str(error))


def _carry(ring: Ring, control: ControlBlock, writer: JournalWriter, parent: int) -> None:
    flushed = synced = alive = time.monotonic()
    beat = -1
    while True:
        control.beat_recorder()
        # asked before reading: rows written before the task's last word are then all seen
        last = control.task_gone
        rows = ring.read()
        if rows:
            writer.append(rows)
        elif last:
            return
        now = time.monotonic()
        if now - flushed >= FLUSH_PERIOD_S:
            to_disk = now - synced >= SYNC_PERIOD_S
            writer.flush(to_disk=to_disk)
            flushed = now
            synced = now if to_disk else synced
        if os.getppid() != parent:
            if control.task_beat != beat:
                beat, alive = control.task_beat, now
            elif now - alive > ORPHAN_PATIENCE_S:
                return
        if not rows:
            time.sleep(IDLE_S)
