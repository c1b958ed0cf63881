"""Repair of a damaged journal: writes the readable messages to a new one and reports losses."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from acquisition.journal.cycles import JournalWriter, read_journal
from acquisition.journal.header import JournalHeader, first_header
from acquisition.journal.mcap_reader import JournalDamage, RawJournal, read_raw_journal
from acquisition.journal.mcap_writer import MOST_LOST_S, JournalFile
from acquisition.journal.monitor import MonitorHeader, MonitorWriter, read_monitor
from acquisition.journal.plate import PlateHeader, PlateJournalWriter, read_plate_journal
from config.errors import RecordingError

_Header = JournalHeader | PlateHeader | MonitorHeader
_KINDS = (JournalHeader, PlateHeader, MonitorHeader)
# number of bytes before the body of a message: record header, sequence number, times
_HEAD_BYTES = 9 + 22


@dataclass(frozen=True)
class Repair:
    """Result of the repair of a journal: messages that were kept, and messages that are lost.

    Attributes:
        kept_rows, lost_rows: Messages read, and messages known to be missing: from their numbers,
            from the count of a closed file, or from the number of rows at the run's end.
        kept_s, lost_s: Duration of these messages [s].
        torn_rows: Number of rows to which the incomplete bytes at the file's end correspond.
        damage: Details of the losses.
        run_id: Run to which the file belongs; empty if unknown.
    """

    kept_rows: int
    lost_rows: int
    kept_s: float
    lost_s: float
    torn_rows: float
    damage: JournalDamage
    run_id: str = ""

    @property
    def whole(self) -> bool:
        """True if the journal is undamaged."""
        return not self.damage.notes

    @property
    def sentences(self) -> tuple[str, ...]:
        """Kept and lost messages, as sentences for users."""
        lost = (
            f"lost {self.lost_rows} rows ({self.lost_s:.2f} s)"
            if self.lost_rows
            else "no row before the last kept row is lost"
        )
        sentences = [f"kept {self.kept_rows} rows ({self.kept_s:.2f} s), {lost}"]
        sentences += [note for note in self.damage.notes if "not closed" not in note]
        if not self.damage.finished:
            torn = (
                f"about {self.torn_rows:.0f} incomplete rows and all "
                if self.torn_rows >= 1.0
                else ""
            )
            sentences.append(
                f"the file was not closed: {torn}rows measured after the last kept row are lost;"
                f" a killed recorder loses at most {MOST_LOST_S:g} s"
            )
        return tuple(sentences)


def examine_journal(path: Path, written: int | None = None) -> Repair:
    """Return the parts of a journal that can be recovered; write nothing.

    Args:
        path: The journal.
        written: Number of rows at the end of the run, if known.

    Raises:
        RecordingError: The file cannot be read, is not a journal of this program, or contains
            nothing readable.
    """
    raw, header = _read_any_journal(path)
    return _summarise(raw, header.run_id, written)


def repair_journal(
    source: Path, target: Path, run_id: str | None = None, written: int | None = None
) -> Repair:
    """Write the readable messages of a journal to a new one, which is closed and complete.

    Every message keeps its number, so that readers see which messages are lost. The new file is
    read back and compared.

    Args:
        source: The journal; it is not changed.
        target: File to write; it must not exist.
        run_id: Run to which the new file belongs; default: the run of the old file.
        written: Number of rows at the end of the run, if known.

    Raises:
        RecordingError: The source contains nothing readable, or the target cannot be written.
    """
    raw, header = _read_any_journal(source)
    was = header.run_id
    if run_id is not None:
        header = header.model_copy(update={"run_id": run_id})
    with _create_writer(target, header) as writer:
        for channel, time_ns, payload, sequence in zip(
            raw.channels, raw.times_ns, raw.payloads, raw.sequences, strict=True
        ):
            writer.copy_message(channel, time_ns, payload, sequence)
    again = read_raw_journal(target)
    if (again.payloads, again.sequences) != (raw.payloads, raw.sequences):
        raise RecordingError(
            f"{target}: the file reads back other values than were written: check the disk, then"
            " recover the run again",
            code="RID-RECORDING-LOST",
        )
    return _summarise(raw, was, written)


def _read_any_journal(path: Path) -> tuple[RawJournal, _Header]:
    """Read and check a journal of any kind; return its messages and header."""
    raw = read_raw_journal(path)
    for model in _KINDS:
        header = first_header(model, raw.headers)
        match header:
            case JournalHeader():
                read_journal(path).recording()
            case PlateHeader():
                read_plate_journal(path)
            case MonitorHeader():
                read_monitor(path)
            case _:
                continue
        return raw, header
    what = "the header of its rows is lost" if raw.payloads else "it contains no readable row"
    raise RecordingError(
        f"{path}: {what}: nothing can be recovered, or the file is not a rid-daq recording",
        code="RID-RECORDING-FOREIGN",
    )


def _create_writer(target: Path, header: _Header) -> JournalFile:
    match header:
        case JournalHeader():
            return JournalWriter(target, header)
        case PlateHeader():
            return PlateJournalWriter(target, header)
        case MonitorHeader():
            return MonitorWriter(target, header)


def _summarise(raw: RawJournal, run_id: str, written: int | None) -> Repair:
    damage = _add_missing_end(raw, written or 0)
    time_s = np.array(raw.times_ns, dtype=float) / 1e9
    row_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.0
    after = np.searchsorted(raw.sequences, [first for first, _ in damage.gaps])
    lost_s = 0.0
    for place, (_, count) in zip(after.tolist(), damage.gaps, strict=True):
        inside = 0 < place < len(time_s)
        lost_s += time_s[place] - time_s[place - 1] - row_s if inside else count * row_s
    torn_rows = 0.0
    if raw.payloads:
        size = _HEAD_BYTES + sum(map(len, raw.payloads)) / len(raw.payloads)
        torn_rows = damage.torn_bytes / size
    return Repair(
        kept_rows=len(raw.payloads),
        lost_rows=damage.rows_lost,
        kept_s=float(time_s[-1] - time_s[0]) + row_s if len(time_s) else 0.0,
        lost_s=max(float(lost_s), 0.0),
        torn_rows=torn_rows,
        damage=damage,
        run_id=run_id,
    )


def _add_missing_end(raw: RawJournal, written: int) -> JournalDamage:
    """Return the damage, including rows that are missing at the end of the journal."""
    damage = raw.damage
    lacking = written - len(raw.payloads) - damage.rows_lost
    if lacking <= 0:
        return damage
    first = raw.sequences[-1] + 1 if raw.sequences else 0
    return replace(damage, gaps=(*damage.gaps, (first, lacking)))
