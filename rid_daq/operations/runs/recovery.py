"""Recovering a run: a new run folder with everything of the old one that can be trusted."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass, replace
from pathlib import Path

from pydantic import JsonValue

from acquisition.journal.mcap_writer import being_written
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import MANIFEST, RECORDING, FileEntry, Manifest, RunStatus
from acquisition.session.repair import Repair, examine_journal, repair_journal
from config.errors import ConfigError, LockedError, RecordingError, RidDaqError
from config.formats.bounded_file import read_file
from rid_daq.runs.run_data import READ
from rid_daq.session.session import as_label, unfinished
from rid_daq.session.versions import software_versions

LARGEST_FILE_BYTES = 1_000_000_000
_JOURNAL = ".mcap"
_RESULTS = (".json", ".html")
_FACTS = ("robot", "simulated_flange", "why")  # the others are results


@dataclass(frozen=True)
class Recovery:
    """What became of a recording or a run.

    Attributes:
        source: The old one; it is as it was.
        target: The new one; None where nothing was wrong with the old one.
        repairs: What was kept of each journal.
        notes: What else a person should know, one sentence each.
        rows_gone: Rows of journals that are missing, or not readable at all.
    """

    source: Path
    target: Path | None
    repairs: dict[str, Repair]
    notes: tuple[str, ...] = ()
    rows_gone: int = 0

    @property
    def lost_rows(self) -> int:
        """Rows known to be missing, of all journals."""
        return self.rows_gone + sum(repair.lost_rows for repair in self.repairs.values())

    @property
    def lost_s(self) -> float:
        """The longest time that a journal is known to lack [s]."""
        return max((repair.lost_s for repair in self.repairs.values()), default=0.0)


def recover_file(source: Path, target: Path) -> Recovery:
    """Write what is readable of one journal as a new file.

    Raises:
        LockedError: The journal is still being written.
        RecordingError: It holds nothing readable, or the new file cannot be written.
    """
    _refuse_open(source)
    repair = examine_journal(source)
    if repair.whole:
        return Recovery(source, None, {source.name: repair})
    if target.exists() or target.is_symlink():
        raise RecordingError(
            f"{target}: exists already; give another name with --output", code="RID-OUTPUT-EXISTS"
        )
    temporary = target.with_name(f"{target.name}.tmp")
    try:
        temporary.unlink(missing_ok=True)
        repair = repair_journal(source, temporary)
        os.link(temporary, target)  # never replaces, whoever else writes here
    except OSError as error:
        raise RecordingError(
            f"{target}: cannot be written: {error.strerror}", code="RID-FILE-WRITE"
        ) from error
    finally:
        temporary.unlink(missing_ok=True)
    return Recovery(source, target, {source.name: repair})


def recover_run(source: Path, root: Path) -> Recovery:
    """Make a new run folder under `root` with what can be trusted of an old one.

    Journals are written again from their checksums; rows that the manifest knows of and that are
    not there count as lost. Other files are copied where the manifest's SHA-256 vouches for them; a
    file that differs from it is left out, and only the original will be taken in its place. Results
    are not copied: they rest on rows that may be lost.

    Raises:
        LockedError: The run is still being recorded.
        RecordingError: Nothing of it is readable, a recording belongs to another run, or the new
            one cannot be written.
    """
    source = source.resolve()
    names, notes = _files(source)
    manifest, problem = _manifest(source)
    notes += problem
    journals = [name for name in names if name.endswith(_JOURNAL)]
    for name in journals:
        _refuse_open(source / name)
    readable = {}
    for name in journals:
        try:
            readable[name] = examine_journal(source / name, _rows(manifest, name))
        except RecordingError as error:
            notes.append(str(error))
    _refuse_foreign(source, manifest, readable)
    if not readable:
        raise RecordingError(
            "; ".join(notes) or f"{source}: no recording ({_JOURNAL}) in it, nothing to recover",
            code="RID-RECORDING-EMPTY",
        )
    others = [n for n in names if n not in journals and not _is_result(n)]
    kept, left_out = _trusted(source, others, manifest)
    notes += left_out + _changed(source, readable, manifest)
    whole = all(repair.whole for repair in readable.values()) and not notes
    if (
        whole
        and manifest is not None
        and manifest.status in (RunStatus.COMPLETE, RunStatus.STOPPED)
    ):
        return Recovery(source, None, readable)
    folder = RunFolder.create(
        root,
        as_label(source.name if manifest is None else manifest.label),
        kind=manifest.kind if manifest is not None else "record",
        software=manifest.software if manifest is not None else software_versions(),
    )
    with unfinished(folder):
        known_files = () if manifest is None else manifest.files
        gone = [n for n in known_files if n.endswith(_JOURNAL) and n not in readable]
        rows_gone = sum(_rows(manifest, name) or 0 for name in gone)
        recovery = Recovery(source, folder.path, {}, tuple(notes), rows_gone)
        recovery = _fill(folder, recovery, kept, {n: _rows(manifest, n) for n in readable})
        known = {} if manifest is None else manifest.facts
        facts: dict[str, JsonValue] = {name: known[name] for name in _FACTS if name in known}
        was = source.name if manifest is None else manifest.run_id
        rows = max(repair.kept_rows for repair in recovery.repairs.values())
        facts |= {"recovered_from": was, "rows": rows, "rows_lost": recovery.lost_rows}
        folder.finish(RunStatus.RECOVERED, facts, _missing(manifest, kept, journals))
    return recovery


def _fill(
    folder: RunFolder, recovery: Recovery, kept: list[str], written: dict[str, int | None]
) -> Recovery:
    repairs = {}
    for name in kept:
        folder.write(name, read_file(recovery.source / name, LARGEST_FILE_BYTES))
    for name, rows in written.items():
        target = folder.file(name)
        target.parent.mkdir(parents=True, exist_ok=True)
        repairs[name] = repair_journal(recovery.source / name, target, folder.run_id, rows)
    return replace(recovery, repairs=repairs)


def _is_result(name: str) -> bool:
    return name.endswith(_RESULTS) and name not in READ


def _rows(manifest: Manifest | None, name: str) -> int | None:
    """Return how many rows a journal held when its run ended, where the manifest says it."""
    if manifest is None:
        return None
    entry = manifest.files.get(name)
    if entry is not None and entry.rows is not None:
        return entry.rows
    rows = manifest.facts.get("rows")
    return rows if name == RECORDING and isinstance(rows, int) else None


def _refuse_foreign(source: Path, manifest: Manifest | None, readable: dict[str, Repair]) -> None:
    """Refuse a folder whose recordings are not all of its own run.

    Raises:
        RecordingError: One is not; the message says whose it is.
    """
    own = {r.run_id for r in readable.values()} if manifest is None else {manifest.run_id}
    own -= {""}
    for name, repair in readable.items():
        if "/" not in name and repair.run_id and (own - {repair.run_id}):
            raise RecordingError(
                f"{source / name}: belongs to run {repair.run_id}, not to"
                f" {', '.join(sorted(own - {repair.run_id}))}: take it out of the folder, put the"
                " original back, then recover the run; or recover that file alone",
                code="RID-RUN-MIXED",
            )


def _changed(source: Path, readable: dict[str, Repair], manifest: Manifest | None) -> list[str]:
    """Return which journals without any damage are not those that the run ended with."""
    entries = {} if manifest is None else manifest.files
    folder = RunFolder(source, "")
    return [
        f"{name}: is not what was written (its SHA-256 differs), though every block is right"
        for name, repair in readable.items()
        if repair.whole and name in entries and not folder.is_unchanged(name, entries[name])
    ]


def _missing(
    manifest: Manifest | None, kept: list[str], journals: list[str]
) -> dict[str, FileEntry]:
    """Return the entries of files that the new folder lacks, so that only originals fit."""
    files = {} if manifest is None else manifest.files
    return {
        name: entry
        for name, entry in files.items()
        if name not in kept and name not in journals and not _is_result(name)
    }


def _refuse_open(path: Path) -> None:
    if being_written(path):
        raise LockedError(
            f"{path}: is still being written: wait until the recording ends, or stop it",
            code="RID-RUN-OPEN",
        )


def _manifest(source: Path) -> tuple[Manifest | None, list[str]]:
    try:
        return RunFolder(source, "").manifest(), []
    except RidDaqError as error:
        return None, [f"{error}; label and kind are lost, and nothing vouches for the other files"]


def _files(source: Path) -> tuple[list[str], list[str]]:
    """Return the names of a folder's files, and what of it is not taken."""
    names, notes = [], []
    probe = RunFolder(source, "")
    for folder, folders, files in os.walk(source, followlinks=False):
        for name in sorted((*folders, *files)):
            path = Path(folder) / name
            relative = str(path.relative_to(source))
            if relative == MANIFEST or name.endswith(".tmp"):
                continue
            try:
                probe.file(relative)
            except (ConfigError, RecordingError) as error:
                notes.append(f"left out: {error}")
                continue
            if path.is_file():
                names.append(relative)
            elif not path.is_dir():
                notes.append(f"left out: {path}: is no file")
    return sorted(names), notes


def _trusted(
    source: Path, names: list[str], manifest: Manifest | None
) -> tuple[list[str], list[str]]:
    """Return which files can be copied, and why others are not or should be looked at."""
    kept, notes = [], []
    for name in names:
        path = source / name
        try:
            data = read_file(path, LARGEST_FILE_BYTES, follow_link=False)
            digest = hashlib.sha256(data).hexdigest()
        except OSError as error:
            notes.append(f"left out: {path}: cannot be read: {error.strerror}")
            continue
        entry = None if manifest is None else manifest.files.get(name)
        if entry is not None and entry.sha256 != digest:
            notes.append(
                f"left out: {name}: is not what was written (its SHA-256 differs): put"
                " the original into the new folder"
            )
            continue
        if manifest is not None and entry is None and manifest.finished_utc and name in READ:
            notes.append(f"left out: {name}: was put into the folder after the run had ended")
            continue
        if manifest is not None and entry is None:
            notes.append(f"{name}: copied, although no manifest vouches for it")
        kept.append(name)
    expected = () if manifest is None else sorted(manifest.files)
    missing = [n for n in expected if n not in names and not _is_result(n)]
    missing = [n for n in missing if not (source / n).is_file()]
    return kept, notes + [f"{name}: is missing" for name in missing]
