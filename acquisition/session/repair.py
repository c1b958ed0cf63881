"""Writing a damaged journal again, whole: what is readable, and how much of it is lost."""

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
_HEAD_BYTES = 9 + 22  # of a message: its record, its number and times


@dataclass(frozen=True)
class Repair:
    """What was kept of a journal, and what is lost.

    Attributes:
        kept_rows, lost_rows: Messages read, and messages known to be missing: by their numbers, by
            the count of a closed file, or by what was written when the run ended.
        kept_s, lost_s: The time that they cover [s].
        torn_rows: Rows that the torn bytes at the end would hold.
        damage: What is missing, in particular.
        run_id: The run that the file says that it belongs to; empty where it does not say.
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
        """Whether nothing is wrong with the journal."""
        return not self.damage.notes

    @property
    def sentences(self) -> tuple[str, ...]:
        """What was kept and what is lost, for people."""
        lost = (
            f"lost {self.lost_rows} rows ({self.lost_s:.2f} s)"
            if self.lost_rows
            else "no row before the last one is lost"
        )
        said = [f"kept {self.kept_rows} rows ({self.kept_s:.2f} s), {lost}"]
        said += [note for note in self.damage.notes if "not closed" not in note]
        if not self.damage.finished:
            torn = f"about {self.torn_rows:.0f} torn rows, and " if self.torn_rows >= 1.0 else ""
            said.append(
                f"the file was not closed: {torn}what was measured after the last row kept is"
                f" lost; a killed recorder loses {MOST_LOST_S:g} s at most"
            )
        return tuple(said)


def examine_journal(path: Path, written: int | None = None) -> Repair:
    """Return what can be kept of a journal, without writing anything.

    Args:
        path: The journal.
        written: Rows that it held when its run ended, where that is known.

    Raises:
        RecordingError: The file cannot be read, is no journal of this program, or holds nothing
            readable.
    """
    raw, header = _read(path)
    return _repair(raw, header.run_id, written)


def repair_journal(
    source: Path, target: Path, run_id: str | None = None, written: int | None = None
) -> Repair:
    """Write what is readable of a journal as a new one, closed and whole.

    Every message keeps its number, so that lost ones stay visible to every reader. What was written
    is read back and compared.

    Args:
        source: The journal; it is not changed.
        target: The file to write; it must not exist.
        run_id: The run that the new file belongs to; the old one's if not given.
        written: Rows that the journal held when its run ended, where that is known.

    Raises:
        RecordingError: The source holds nothing readable, or the target cannot be written.
    """
    raw, header = _read(source)
    was = header.run_id
    if run_id is not None:
        header = header.model_copy(update={"run_id": run_id})
    with _writer(target, header) as writer:
        for channel, time_ns, payload, sequence in zip(
            raw.channels, raw.times_ns, raw.payloads, raw.sequences, strict=True
        ):
            writer.copy_message(channel, time_ns, payload, sequence)
    again = read_raw_journal(target)
    if (again.payloads, again.sequences) != (raw.payloads, raw.sequences):
        raise RecordingError(
            f"{target}: does not hold what was written; check the disk", code="RID-RECORDING-LOST"
        )
    return _repair(raw, was, written)


def _read(path: Path) -> tuple[RawJournal, _Header]:
    """Return a journal's messages and header, having read it as what it is."""
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
    what = "the header of its rows is lost" if raw.payloads else "no readable row in it"
    raise RecordingError(
        f"{path}: {what}: nothing can be recovered, or it is no rid-daq recording",
        code="RID-RECORDING-FOREIGN",
    )


def _writer(target: Path, header: _Header) -> JournalFile:
    match header:
        case JournalHeader():
            return JournalWriter(target, header)
        case PlateHeader():
            return PlateJournalWriter(target, header)
        case MonitorHeader():
            return MonitorWriter(target, header)


def _repair(raw: RawJournal, run_id: str, written: int | None) -> Repair:
    damage = _with_end(raw, written or 0)
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


def _with_end(raw: RawJournal, written: int) -> JournalDamage:
    """Return a journal's damage with the rows that its end lacks of those once written."""
    damage = raw.damage
    lacking = written - len(raw.payloads) - damage.rows_lost
    if lacking <= 0:
        return damage
    first = raw.sequences[-1] + 1 if raw.sequences else 0
    return replace(damage, gaps=(*damage.gaps, (first, lacking)))
