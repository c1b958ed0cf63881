"""`CycleReader`: incremental reader of a run's journal, as rows and as recordings."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.journal.cycle_row import MESSAGES, joints_of_row
from acquisition.journal.header import JournalHeader, first_header
from acquisition.journal.mcap_reader import JournalDamage, JournalReader
from acquisition.journal.row_layout import CDR_LITTLE_ENDIAN, packed_dtype
from acquisition.recording.recording import Recording, concatenate_recordings
from config.errors import RecordingError


class CycleReader:
    """Reader of a journal; each call continues after the last row that was read. A context manager.

    Args:
        path: The `.mcap` file, complete or not; it is not changed.

    Raises:
        RecordingError: The file cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._reader = JournalReader(path)
        self._header: JournalHeader | None = None
        self._last_s = -np.inf

    def __enter__(self) -> CycleReader:
        return self

    def __exit__(self, *_: object) -> None:
        self._reader.__exit__()

    @property
    def header(self) -> JournalHeader:
        """Header of the journal; known once a row was read.

        Raises:
            RecordingError: There is no row, or the header is lost.
        """
        if self._header is None:
            raise RecordingError(
                f"{self.path}: contains no readable row of a rid-daq recording",
                code="RID-RECORDING-EMPTY",
            )
        return self._header

    @property
    def damage(self) -> JournalDamage:
        """Damage of a journal that was read to its end and is no longer written."""
        return self._reader.damage()

    def rows(self, *, growing: bool = False) -> Iterator[NDArray[Any]]:
        """Yield the new rows in the layout of `MESSAGES`, after each quarter MB that is read.

        Args:
            growing: True if the file may still be written.

        Raises:
            RecordingError: The file cannot be read, or is not a journal of this program.
        """
        for messages in self._reader.pieces(growing=growing):
            if self._header is None:
                self._header = first_header(JournalHeader, self._reader.headers)
            if self._header is None:
                raise RecordingError(
                    f"{self.path}: the joint names are lost, so the rows cannot be used",
                    code="RID-RECORDING-DAMAGED",
                )
            yield self._as_rows(messages.payloads, self._header)

    def recordings(self, *, growing: bool = False) -> Iterator[Recording]:
        """Yield the new rows as parts of one `Recording`; errors as in `rows`.

        Raises:
            RecordingError: The rows are not a valid recording (time stamps that do not increase).
        """
        for rows in self.rows(growing=growing):
            part = recording_of(self.header, rows)
            if part.time_s[0] <= self._last_s:
                raise RecordingError(
                    f"recording: time stamps must increase; {part.time_s[0]:.6f} s comes after"
                    f" {self._last_s:.6f} s",
                    code="RID-RECORDING-CLOCK",
                )
            self._last_s = float(part.time_s[-1])
            yield part

    @property
    def most_rows(self) -> int:
        """Largest number of rows that the present file can have; known once a row was read."""
        joints = len(self.header.joint_names)
        size = packed_dtype(MESSAGES[self.header.layout][1], joints).itemsize
        return self.path.stat().st_size // size

    def _as_rows(self, payloads: list[bytes], header: JournalHeader) -> NDArray[Any]:
        joints = len(header.joint_names)
        dtype = packed_dtype(MESSAGES[header.layout][1], joints)
        size = len(CDR_LITTLE_ENDIAN) + dtype.itemsize
        for payload in payloads:
            if len(payload) != size or not payload.startswith(CDR_LITTLE_ENDIAN):
                found = joints_of_row(len(payload) - len(CDR_LITTLE_ENDIAN))
                raise RecordingError(
                    f"{self.path}: its rows have {len(payload)} bytes, but rows of {joints} joints"
                    f" have {size} bytes"
                    + (f" (they look like {found} joints)" if found else "")
                    + ": the file belongs to another program or version",
                    code="RID-RECORDING-FOREIGN",
                )
        return np.frombuffer(b"".join(payload[4:] for payload in payloads), dtype=dtype)


def read_tail(path: Path, seconds: float) -> Recording:
    """Return the end of a journal; earlier rows do not stay in memory.

    Args:
        path: The `.mcap` file of an ended recording.
        seconds: Shortest duration of the result [s]; a shorter journal is returned completely.

    Raises:
        RecordingError: The file cannot be read, is not a journal of this program, has no readable
            row, or its time stamps do not increase.
    """
    kept: deque[Recording] = deque()
    with CycleReader(path) as reader:
        for part in reader.recordings():
            kept.append(part)
            while len(kept) > 1 and part.time_s[-1] - kept[1].time_s[0] >= seconds:
                kept.popleft()
        if not kept:
            raise RecordingError(
                f"{path}: contains no readable row of a rid-daq recording",
                code="RID-RECORDING-EMPTY",
            )
    return concatenate_recordings(kept)


def recording_of(header: JournalHeader, rows: NDArray[Any]) -> Recording:
    """Return rows of a journal as a `Recording`.

    Raises:
        RecordingError: The rows are not a valid recording (time stamps that do not increase).
    """
    answered, imported = rows["valid"] != 0, header.source == "import"
    has_commands = not imported or header.has_commands
    warmth = rows["temperature_k"] if imported else None
    return Recording(
        joint_names=header.joint_names,
        time_s=rows["time_s"],
        position=rows["position"],
        torque_nm=rows["torque_nm"],
        valid=answered if imported else answered.all(axis=1),
        phase=rows["phase"],
        sample_index=rows["sample_index"],
        target_position=None if imported else rows["target_position"],
        velocity_command=rows["velocity_command"] if has_commands else None,
        sample_period_s=header.sample_period_s,
        samples_per_period=header.samples_per_period,
        torque_filter=header.torque_filter,
        temperature_k=None if warmth is None or np.isnan(warmth).all() else warmth,
        answered=None if imported else answered,
        source=header.source,
        cell_name=header.cell_name,
        robot_name=header.robot_name,
        run_id=header.run_id,
    )
