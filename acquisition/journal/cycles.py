"""Journal of a run: writer, and reader for complete, unfinished, torn or damaged MCAP files."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.journal.cycle_reader import CycleReader, recording_of
from acquisition.journal.cycle_row import MESSAGES
from acquisition.journal.disk_reserve import RESERVE_BYTES
from acquisition.journal.header import JournalHeader
from acquisition.journal.mcap_reader import JournalDamage
from acquisition.journal.mcap_writer import ROWS_AT_ONCE, JournalFile
from acquisition.journal.row_layout import message_text, packed_dtype
from acquisition.recording.recording import Recording
from config.arrays import release

TOPIC = "/cycle"


class JournalWriter(JournalFile):
    """Writer of rows to a new MCAP file; a context manager.

    Args:
        path: The file; it must not exist.
        header: Header of the recording.

    Raises:
        RecordingError: The file cannot be made or written (disk full, no permission, it exists).
    """

    def __init__(self, path: Path, header: JournalHeader) -> None:
        joints, (name, fields) = len(header.joint_names), MESSAGES[header.layout]
        self._row_size = packed_dtype(fields, joints).itemsize
        pairs = header.to_metadata()
        super().__init__(path, pairs, reserve_bytes=RESERVE_BYTES)
        self._channel = self.add_channel(TOPIC, name, message_text(fields, joints), pairs)

    def append(self, rows: bytes) -> None:
        """Write whole rows, given as bytes in the layout of the header."""
        size = self._row_size
        for start in range(0, len(rows), size):
            time_s: float = struct.unpack_from("<d", rows, start)[0]
            self.add_message(self._channel, time_s, rows[start : start + size])

    def append_array(self, rows: NDArray[Any]) -> None:
        """Write many rows in the layout of the header, faster than `append` does."""
        self.add_messages(self._channel, rows["time_s"], rows)


def write_imported(path: Path, recording: Recording) -> None:
    """Write an imported recording to a new file; reading it returns the same bits.

    Raises:
        RecordingError: The file cannot be made or written.
    """
    header = JournalHeader(
        joint_names=recording.joint_names,
        sample_period_s=recording.sample_period_s,
        samples_per_period=recording.samples_per_period,
        source="import",
        has_commands=recording.velocity_command is not None,
        torque_filter=recording.torque_filter,
        robot_name=recording.robot_name,
        run_id=recording.run_id,
    )
    fields = MESSAGES[header.layout][1]
    dtype = packed_dtype(fields, len(recording.joint_names))
    with JournalWriter(path, header) as writer:
        for first in range(0, len(recording), ROWS_AT_ONCE):
            part = slice(first, first + ROWS_AT_ONCE)
            rows = np.zeros(len(recording.time_s[part]), dtype)
            for name, *_ in fields:
                values = getattr(recording, name)
                rows[name] = np.nan if values is None else values[part]
                if values is not None:
                    release(values)
            writer.append_array(rows)


@dataclass(frozen=True, eq=False)
class Journal:
    """Readable content of a journal.

    Attributes:
        header: Joints, sample period, provenance.
        rows: Shape (rows,). The rows, in the order written.
        damage: Missing data.
    """

    header: JournalHeader
    rows: NDArray[Any]
    damage: JournalDamage

    def recording(self) -> Recording:
        """Return the rows as a `Recording`.

        Raises:
            RecordingError: The rows are not a valid recording (time stamps that do not increase).
        """
        return recording_of(self.header, self.rows)


def read_journal(path: Path) -> Journal:
    """Read a journal, complete or damaged.

    Args:
        path: The `.mcap` file; it is not changed.

    Returns:
        All rows with a correct checksum, and the missing data.

    Raises:
        RecordingError: The file cannot be read, is not a journal of this program, or has no
            readable row.
    """
    with CycleReader(path) as reader:
        parts = list(reader.rows())
        header = reader.header
        rows = np.concatenate(parts)
        rows.setflags(write=False)
        return Journal(header=header, rows=rows, damage=reader.damage)
