"""Journal of an imported force plate: its readings at the times of the recording."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from pydantic import Field

from acquisition.journal.header import HeaderModel, first_header
from acquisition.journal.mcap_reader import read_raw_journal
from acquisition.journal.mcap_writer import JournalFile
from acquisition.journal.row_layout import CDR_LITTLE_ENDIAN, Fields, message_text, packed_dtype
from acquisition.recording.reaction import Reaction
from config.arrays import FloatArray
from config.cell.torque_filter import ButterworthFilter
from config.errors import RecordingError

_FIELDS: Final[Fields] = (
    ("time_s", "f8", 1, "time of the recording's row [s]"),
    ("reading", "f8", None, "force [N] or moment [N m] of each reading; 0 if not valid"),
    ("valid", "u1", None, "1 if the reading is valid, else 0"),
)


class ImportedPlateHeader(HeaderModel):
    """Everything needed to read the rows as a `Reaction`."""

    reading_names: tuple[str, ...] = Field(min_length=1)
    base_wrench_matrix: tuple[tuple[float, ...], ...]
    low_pass: ButterworthFilter | None
    drift_limit_n_s: float
    run_id: str


def write_imported_plate(path: Path, reaction: Reaction, time_s: FloatArray, run_id: str) -> None:
    """Write readings to a new file; reading it returns the same bits.

    Args:
        path: The file; it must not exist.
        reaction: The readings.
        time_s: Shape (samples,). Times of the recording [s].
        run_id: Run of the recording.

    Raises:
        RecordingError: The file cannot be made or written.
    """
    count = len(reaction.channel_names)
    header = ImportedPlateHeader(
        reading_names=reaction.channel_names,
        base_wrench_matrix=tuple(map(tuple, reaction.base_wrench_matrix.tolist())),
        low_pass=reaction.low_pass,
        drift_limit_n_s=reaction.drift_limit_n_s,
        run_id=run_id,
    )
    rows = np.zeros(len(reaction), packed_dtype(_FIELDS, count))
    rows["time_s"], rows["reading"], rows["valid"] = time_s, reaction.channels_n, reaction.valid
    pairs = header.to_metadata()
    with JournalFile(path, pairs) as file:
        text = message_text(_FIELDS, count)
        channel = file.add_channel("/plate", "rid_daq/msg/ImportedPlate", text, pairs)
        file.add_messages(channel, rows["time_s"], rows)


def read_imported_plate(path: Path, samples: int, run_id: str) -> Reaction:
    """Read the readings of an imported plate.

    Args:
        path: The `.mcap` file.
        samples: Number of rows of the recording.
        run_id: Run of the recording.

    Raises:
        RecordingError: The file cannot be read, is damaged, or belongs to another run.
    """
    raw = read_raw_journal(path)
    header = first_header(ImportedPlateHeader, raw.headers)
    if header is None:
        raise RecordingError(
            f"{path}: contains no readable header of an imported force plate",
            code="RID-RECORDING-EMPTY",
        )
    dtype = packed_dtype(_FIELDS, len(header.reading_names))
    bodies = [payload[len(CDR_LITTLE_ENDIAN) :] for payload in raw.payloads]
    if len(bodies) != samples or {len(body) for body in bodies} != {dtype.itemsize}:
        raise RecordingError(
            f"{path}: has {len(bodies)} rows for {samples} rows of the recording: restore the"
            " original file",
            code="RID-RECORDING-DAMAGED",
        )
    if header.run_id != run_id:
        raise RecordingError(
            f"{path}: belongs to run {header.run_id}, not to {run_id}: restore the original file",
            code="RID-RUN-MIXED",
        )
    rows = np.frombuffer(b"".join(bodies), dtype=dtype)
    return Reaction(
        channel_names=header.reading_names,
        channels_n=rows["reading"],
        valid=rows["valid"] != 0,
        base_wrench_matrix=np.array(header.base_wrench_matrix),
        low_pass=header.low_pass,
        drift_limit_n_s=header.drift_limit_n_s,
    )
