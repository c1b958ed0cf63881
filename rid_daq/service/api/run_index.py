"""`RunIndex`: summaries of all runs of a service; a run is read again only after a change."""

from __future__ import annotations

import functools
import os
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import MANIFEST, Manifest
from acquisition.runs.run_id import RUN_ID
from config.errors import RecordingError
from rid_daq.service.folder_files import CHANGING_S, motion_kind
from rid_daq.service.records import Record
from rid_daq.terminal.choices import MODEL

REPORT: Final = "report.html"
MOTION: Final = "motion.yaml"
DAMAGED: Final = "damaged"

_Stamp = tuple[int, int]


class RunEntry(Record):
    """Summary of a run.

    Attributes:
        id, label, kind, status, created_utc: As in the manifest; `status` can also be "damaged".
        robot, cell: Names of robot and cell; empty if they are unknown.
        motion: Kind of the motion.
        verdict: Verdict of the result in a word; empty without a result.
        headline: The verdict in a line.
        reason: Reason for which the run was stopped; empty for a run that was not stopped.
        session: Id of the session in which the run was recorded; empty outside a session.
        model: SHA-256 of the run's model; empty without one.
        used_model, used_runs: SHA-256 of the model, and ids of the runs, that the result uses.
        problem: Reason why the manifest cannot be read.
        files: Names of the files in the manifest.
    """

    id: str
    label: str
    kind: str
    status: str
    created_utc: str
    robot: str = ""
    cell: str = ""
    verdict: str = ""
    headline: str = ""
    reason: str = ""
    session: str = ""
    model: str = ""
    used_model: str = ""
    used_runs: tuple[str, ...] = ()
    motion: str = ""
    has_report: bool = False
    problem: str = ""
    files: tuple[str, ...] = ()


class RunIndex:
    """Summaries of the runs below a folder; several threads may use it.

    A summary is kept as long as the time stamps of the run's folder and manifest are the same.

    Args:
        root: Folder of the run folders.
    """

    def __init__(self, root: Path) -> None:
        self._root = root
        self._entries: dict[str, tuple[_Stamp, RunEntry | None]] = {}
        self._newest_first: Sequence[RunEntry] = []
        self._lock = threading.Lock()
        self._scans = 0  # number of scans that have begun

    def newest_first(self) -> Sequence[RunEntry]:
        """Return the runs, newest first; a folder with another run's manifest is left out.

        Calls that wait at the same time share one scan of the folder, which begins after them.
        """
        before = self._scans
        with self._lock:
            if self._scans <= before:
                self._scan()
            return self._newest_first

    def _scan(self) -> None:
        self._scans += 1
        root = self._root.resolve()
        present = {name: self._entry_of(root, name) for name in self._run_names()}
        self._entries = {name: each for name, each in present.items() if each is not None}
        found = sorted(self._entries.items(), reverse=True)
        self._newest_first = [entry for _, (_, entry) in found if entry is not None]

    def _run_names(self) -> list[str]:
        try:
            with os.scandir(self._root) as listed:
                return [
                    each.name
                    for each in listed
                    if RUN_ID.fullmatch(each.name) and not each.is_symlink()
                ]
        except FileNotFoundError:
            return []

    def _entry_of(self, root: Path, name: str) -> tuple[_Stamp, RunEntry | None] | None:
        """Return the stamp and summary of a run; None if its folder has just been removed."""
        try:
            stamp = _stamp_of(f"{root}/{name}")
        except OSError:
            return None
        known = self._entries.get(name)
        if known is not None and known[0] == stamp:
            return known
        entry = read_entry(RunFolder(root / name, name))
        is_settled = time.time_ns() - max(stamp) > CHANGING_S * 1e9
        return (stamp if is_settled else (0, 0)), entry


def read_entry(folder: RunFolder) -> RunEntry | None:
    """Return the summary of a run; None if the manifest is of another run."""
    try:
        manifest = folder.manifest()
    except RecordingError as error:
        return RunEntry(
            id=folder.run_id,
            label="",
            kind="",
            status=DAMAGED,
            created_utc="",
            problem=str(error),
        )
    return entry_of(folder, manifest) if manifest.run_id == folder.run_id else None


def entry_of(folder: RunFolder, manifest: Manifest) -> RunEntry:
    """Return the summary of a run with a readable manifest."""

    def fact(name: str) -> str:
        found = manifest.facts.get(name)
        return found if isinstance(found, str) else ""

    model, used = manifest.files.get(MODEL), manifest.facts.get("used_runs")
    return RunEntry(
        id=manifest.run_id,
        label=manifest.label,
        kind=sys.intern(manifest.kind),
        status=sys.intern(manifest.status),
        created_utc=manifest.created_utc,
        robot=sys.intern(fact("robot")),
        cell=sys.intern(fact("cell")),
        verdict=sys.intern(fact("verdict")),
        headline=fact("headline"),
        reason=fact("why"),
        session=sys.intern(fact("session")),
        model="" if model is None else model.sha256,
        used_model=fact("used_model"),
        used_runs=tuple(map(str, used)) if isinstance(used, list) else (),
        motion=motion_kind(folder.file(MOTION)) if MOTION in manifest.files else "",
        has_report=folder.file(REPORT).exists(),
        files=tuple(map(sys.intern, sorted(manifest.files))),
    )


def _stamp_of(folder: str) -> _Stamp:
    """Return the time stamps of a run's folder and manifest [ns]."""
    changed_ns = os.stat(folder).st_mtime_ns
    try:
        return changed_ns, os.stat(f"{folder}/{MANIFEST}").st_mtime_ns
    except FileNotFoundError:
        return changed_ns, 0


@functools.lru_cache(8)
def run_index(root: Path) -> RunIndex:
    """Return the index of a folder of runs."""
    return RunIndex(root)
