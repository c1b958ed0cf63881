"""A run's journal, written and read: an MCAP file, finished, unfinished, torn or damaged."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.journal.cycle_reader import CycleReader, recording_of
from acquisition.journal.cycle_row import FIELDS, MESSAGE_NAME, row_struct
from acquisition.journal.disk_reserve import RESERVE_BYTES
from acquisition.journal.header import JournalHeader
from acquisition.journal.mcap_reader import JournalDamage
from acquisition.journal.mcap_writer import JournalFile
from acquisition.journal.row_layout import message_text
from acquisition.recording.recording import Recording

TOPIC = "/cycle"


class JournalWriter(JournalFile):
    """Writes rows to a new MCAP file; a context manager.

    Args:
        path: The file; it must not exist.
        header: What the recording says about itself.

    Raises:
        RecordingError: The file cannot be made or written (disk full, no permission, it exists).
    """

    def __init__(self, path: Path, header: JournalHeader) -> None:
        joints = len(header.joint_names)
        self._row_size = row_struct(joints).size
        pairs = header.to_metadata()
        super().__init__(path, pairs, reserve_bytes=RESERVE_BYTES)
        self._channel = self.add_channel(TOPIC, MESSAGE_NAME, message_text(FIELDS, joints), pairs)

    def append(self, rows: bytes) -> None:
        """Write whole rows, as the ring gives them."""
        size = self._row_size
        for start in range(0, len(rows), size):
            time_s: float = struct.unpack_from("<d", rows, start)[0]
            self.add_message(self._channel, time_s, rows[start : start + size])


@dataclass(frozen=True, eq=False)
class Journal:
    """What could be read of a journal.

    Attributes:
        header: Joints, sample period, provenance.
        rows: Shape (rows,). The rows, in the order written.
        damage: What is missing.
    """

    header: JournalHeader
    rows: NDArray[Any]
    damage: JournalDamage

    def recording(self) -> Recording:
        """Return the rows as a `Recording`.

        Raises:
            RecordingError: The rows do not make one (time stamps that do not increase).
        """
        return recording_of(self.header, self.rows)


def read_journal(path: Path) -> Journal:
    """Read a journal, whatever state it is in.

    Args:
        path: The `.mcap` file; it is not changed.

    Returns:
        Every row whose checksum is right, and what is missing.

    Raises:
        RecordingError: The file cannot be read, is not a journal of this program, or holds no
            readable row.
    """
    with CycleReader(path) as reader:
        parts = list(reader.rows())
        header = reader.header
        rows = np.concatenate(parts)
        rows.setflags(write=False)
        return Journal(header=header, rows=rows, damage=reader.damage)
