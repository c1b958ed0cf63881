"""A run's journal, written and read: an MCAP file, finished, unfinished, torn or damaged."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.journal.cycle_row import (
    CDR_LITTLE_ENDIAN,
    MESSAGE_NAME,
    joints_of_row,
    message_definition,
    row_dtype,
    row_struct,
)
from acquisition.journal.disk_reserve import RESERVE_BYTES
from acquisition.journal.header import JournalHeader, first_header
from acquisition.journal.mcap_reader import JournalDamage, read_raw_journal
from acquisition.journal.mcap_writer import JournalFile
from acquisition.recording.recording import Recording
from config.errors import RecordingError

TOPIC = "/cycle"


class JournalWriter(JournalFile):
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
        joints = len(header.joint_names)
        self._row_size = row_struct(joints).size
        pairs = header.to_metadata()
        super().__init__(path, pairs, reserve_bytes=RESERVE_BYTES)
        self._channel = self.add_channel(TOPIC, MESSAGE_NAME, message_definition(joints), pairs)

    def append(self, rows: bytes) -> None:
        """Write whole rows, as the ring gives them."""
        size = self._row_size
        for start in range(0, len(rows), size):
            time_s: float = struct.unpack_from("<d", rows, start)[0]
            self.add_message(self._channel, time_s, rows[start : start + size])


@dataclass(frozen=True, eq=False)
class Journal:
    """What could be read of a journal.

    Attributes
    ----------
    header : JournalHeader
        Joints, sample period, provenance.
    rows : ndarray of `row_dtype`, shape (rows,)
        The rows, in the order written.
    damage : JournalDamage
        What is missing.
    """

    header: JournalHeader
    rows: NDArray[Any]
    damage: JournalDamage

    def recording(self) -> Recording:
        """Return the rows as a `Recording`.

        Raises
        ------
        RecordingError
            The rows do not make one (time stamps that do not increase).
        """
        rows, header = self.rows, self.header
        answered = rows["valid"] != 0
        return Recording(
            joint_names=header.joint_names,
            time_s=rows["time_s"],
            position=rows["position"],
            torque_nm=rows["torque_nm"],
            valid=answered.all(axis=1),
            phase=rows["phase"],
            sample_index=rows["sample_index"],
            target_position=rows["target_position"],
            velocity_command=rows["velocity_command"],
            sample_period_s=header.sample_period_s,
            samples_per_period=header.samples_per_period,
            torque_filter=header.torque_filter,
            answered=answered,
            source="cell",
            cell_name=header.cell_name,
            robot_name=header.robot_name,
            run_id=header.run_id,
        )


def read_journal(path: Path) -> Journal:
    """Read a journal, whatever state it is in.

    Parameters
    ----------
    path : Path
        The `.mcap` file; it is not changed.

    Returns
    -------
    Journal
        Every row whose checksum is right, and what is missing.

    Raises
    ------
    RecordingError
        The file cannot be read, is not a journal of this program, or holds no readable row.
    """
    raw = read_raw_journal(path)
    if not raw.payloads:
        raise RecordingError(f"{path}: no readable row of a rid-daq recording in it")
    header = first_header(JournalHeader, raw.headers)
    if header is None:
        raise RecordingError(f"{path}: the names of the joints are lost, rows alone mean nothing")
    try:
        rows = _rows(raw.payloads, len(header.joint_names))
    except RecordingError as error:
        raise RecordingError(f"{path}: {error}") from None
    return Journal(header=header, rows=rows, damage=raw.damage)


def _rows(payloads: list[bytes], joints: int) -> NDArray[Any]:
    dtype = row_dtype(joints)
    size = len(CDR_LITTLE_ENDIAN) + dtype.itemsize
    for payload in payloads:
        if len(payload) != size or not payload.startswith(CDR_LITTLE_ENDIAN):
            found = joints_of_row(len(payload) - len(CDR_LITTLE_ENDIAN))
            raise RecordingError(
                f"its rows have {len(payload)} bytes, those of {joints} joints have {size}"
                + (f" (they look like {found} joints)" if found else "")
                + ": another program's or version's file"
            )
    rows = np.frombuffer(b"".join(payload[4:] for payload in payloads), dtype=dtype)
    rows.setflags(write=False)
    return rows
