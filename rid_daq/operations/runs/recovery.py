"""Recover a run: a new run folder with all data of the old one that are verified."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass, replace
from pathlib import Path

from pydantic import JsonValue

from acquisition.journal.mcap_writer import is_being_written
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import MANIFEST, RECORDING, FileEntry, Manifest, RunStatus
from acquisition.session.repair import Repair, examine_journal, repair_journal
from config.errors import ConfigError, LockedError, RecordingError, RidDaqError
from config.formats.bounded_file import read_file
from rid_daq.runs.run_data import READ
from rid_daq.session.session import as_label, mark_unfinished
from rid_daq.session.versions import software_versions

LARGEST_FILE_BYTES = 1_000_000_000
_JOURNAL = ".mcap"
_RESULTS = (".json", ".html")
_FACTS = ("robot", "cell", "session", "operator", "simulated_flange", "stop", "why")
"""Facts of the old manifest that are kept; all other facts follow from rows that may be lost."""


@dataclass(frozen=True)
class Recovery:
    """Result of recovering a recording or a run.

    Attributes:
        source: The old recording or run; it is unchanged.
        target: The new recording or run; None if the old one was undamaged.
        repairs: Copied and lost rows of each journal.
        notes: Sentences about files that were left out, changed or missing.
        rows_gone: Number of rows of journals that are missing, or completely unreadable.
    """

    source: Path
    target: Path | None
    repairs: dict[str, Repair]
    notes: tuple[str, ...] = ()
    rows_gone: int = 0

    @property
    def lost_rows(self) -> int:
        """Number of rows known to be missing, of all journals."""
        return self.rows_gone + sum(repair.lost_rows for repair in self.repairs.values())

    @property
    def lost_s(self) -> float:
        """Longest time that is known to be missing in a journal [s]."""
        return max((repair.lost_s for repair in self.repairs.values()), default=0.0)


def recover_file(source: Path, target: Path) -> Recovery:
    """Write the readable part of one journal as a new file, unless the journal is undamaged.

    Raises:
        LockedError: The journal is still being written.
        RecordingError: The journal contains nothing readable, or the new file cannot be written.
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
        # os.link never replaces a file that another program has made in the meantime.
        os.link(temporary, target)
    except OSError as error:
        raise RecordingError(
            f"{target}: cannot be written: {error.strerror}", code="RID-FILE-WRITE"
        ) from error
    finally:
        temporary.unlink(missing_ok=True)
    return Recovery(source, target, {source.name: repair})


def recover_run(source: Path, root: Path) -> Recovery:
    """Make a new run folder under `root` with the verified data of a damaged one.

    Journals are written again from their blocks with correct checksums. Rows that the manifest
    counts and the journal lacks are reported as lost. Other files are copied if their SHA-256
    agrees with the manifest; some that no manifest lists are copied with a note. A file that
    differs is left out; the new folder accepts only the original in its place. Results are not
    copied, because they were computed from rows that may be lost.

    Raises:
        LockedError: The run is still being recorded.
        RecordingError: The run contains nothing readable, a recording belongs to another run, or
            the new folder cannot be written.
    """
    source = source.resolve()
    names, notes = _folder_files(source)
    manifest, problem = _read_manifest(source)
    notes += problem
    journals = [name for name in names if name.endswith(_JOURNAL)]
    for name in journals:
        _refuse_open(source / name)
    readable = {}
    for name in journals:
        try:
            readable[name] = examine_journal(source / name, _expected_rows(manifest, name))
        except RecordingError as error:
            notes.append(str(error))
    _refuse_other_runs(source, manifest, readable)
    if not readable:
        raise RecordingError(
            "; ".join(notes)
            or f"{source}: the folder contains no recording ({_JOURNAL}), so"
            " there is nothing to recover",
            code="RID-RECORDING-EMPTY",
        )
    others = [n for n in names if n not in journals and not _is_result(n)]
    kept, left_out = _verified_files(source, others, manifest)
    notes += left_out + _changed_journals(source, readable, manifest)
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
    with mark_unfinished(folder):
        known_files = () if manifest is None else manifest.files
        gone = [n for n in known_files if n.endswith(_JOURNAL) and n not in readable]
        rows_gone = sum(_expected_rows(manifest, name) or 0 for name in gone)
        recovery = Recovery(source, folder.path, {}, tuple(notes), rows_gone)
        recovery = _copy_files(
            folder, recovery, kept, {n: _expected_rows(manifest, n) for n in readable}
        )
        known = {} if manifest is None else manifest.facts
        facts: dict[str, JsonValue] = {name: known[name] for name in _FACTS if name in known}
        was = source.name if manifest is None else manifest.run_id
        rows = max(repair.kept_rows for repair in recovery.repairs.values())
        facts |= {"recovered_from": was, "rows": rows, "rows_lost": recovery.lost_rows}
        folder.finish(RunStatus.RECOVERED, facts, _missing_entries(manifest, kept, journals))
    return recovery


def _copy_files(
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


def _expected_rows(manifest: Manifest | None, name: str) -> int | None:
    """Return the number of rows of a journal when its run ended; None if the manifest lacks it."""
    if manifest is None:
        return None
    entry = manifest.files.get(name)
    if entry is not None and entry.rows is not None:
        return entry.rows
    rows = manifest.facts.get("rows")
    return rows if name == RECORDING and isinstance(rows, int) else None


def _refuse_other_runs(
    source: Path, manifest: Manifest | None, readable: dict[str, Repair]
) -> None:
    """Refuse a folder with recordings of several runs.

    Raises:
        RecordingError: A recording belongs to another run; the text names that run.
    """
    run_ids = {r.run_id for r in readable.values()} if manifest is None else {manifest.run_id}
    run_ids -= {""}
    for name, repair in readable.items():
        if "/" not in name and repair.run_id and (run_ids - {repair.run_id}):
            raise RecordingError(
                f"{source / name}: belongs to run {repair.run_id}, not to"
                f" {', '.join(sorted(run_ids - {repair.run_id}))}: remove this file from the"
                " folder, restore the original, then recover the run; or recover this file alone",
                code="RID-RUN-MIXED",
            )


def _changed_journals(
    source: Path, readable: dict[str, Repair], manifest: Manifest | None
) -> list[str]:
    """Return notes on undamaged journals that differ from the manifest."""
    entries = {} if manifest is None else manifest.files
    folder = RunFolder(source, "")
    return [
        f"{name}: its SHA-256 differs from the manifest, although all blocks are correct"
        for name, repair in readable.items()
        if repair.whole and name in entries and not folder.is_unchanged(name, entries[name])
    ]


def _missing_entries(
    manifest: Manifest | None, kept: list[str], journals: list[str]
) -> dict[str, FileEntry]:
    """Return the entries of files that were not copied; the run accepts only their originals."""
    files = {} if manifest is None else manifest.files
    return {
        name: entry
        for name, entry in files.items()
        if name not in kept and name not in journals and not _is_result(name)
    }


def _refuse_open(path: Path) -> None:
    if is_being_written(path):
        raise LockedError(
            f"{path}: is still being written: wait until the recording ends, or stop it",
            code="RID-RUN-OPEN",
        )


def _read_manifest(source: Path) -> tuple[Manifest | None, list[str]]:
    try:
        return RunFolder(source, "").manifest(), []
    except RidDaqError as error:
        return None, [
            f"{error}; label and kind of the run are lost, and the other files cannot be verified"
        ]


def _folder_files(source: Path) -> tuple[list[str], list[str]]:
    """Return the names of a folder's files, and notes on entries that are left out."""
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
                notes.append(f"left out: {path}: is not a regular file")
    return sorted(names), notes


def _verified_files(
    source: Path, names: list[str], manifest: Manifest | None
) -> tuple[list[str], list[str]]:
    """Return the files to copy, and notes on files that are left out or not verified."""
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
                f"left out: {name}: its SHA-256 differs from the manifest: put the original into"
                " the new folder"
            )
            continue
        if manifest is not None and entry is None and manifest.finished_utc and name in READ:
            notes.append(f"left out: {name}: it was added to the folder after the run had ended")
            continue
        if manifest is not None and entry is None:
            notes.append(
                f"{name}: copied, but the manifest does not list it, so it is not verified"
            )
        kept.append(name)
    expected = () if manifest is None else sorted(manifest.files)
    missing = [n for n in expected if n not in names and not _is_result(n)]
    missing = [n for n in missing if not (source / n).is_file()]
    return kept, notes + [f"{name}: is missing" for name in missing]
