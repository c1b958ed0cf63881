"""`RunFolder`: everything about one run in one folder, complete and portable.

`manifest.json` names every file of the run with its SHA-256, as it was when the run was made. Files
are written whole or not at all. The id is generated, the label is text: neither can lead outside
the folder. What somebody else puts into the folder is a stray: it is left alone.
"""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from pydantic import JsonValue, ValidationError

from acquisition.runs.manifest import (
    FORMAT,
    MANIFEST,
    FileEntry,
    Manifest,
    RunStatus,
    digest_of,
    entry_of,
    require_label,
)
from acquisition.runs.run_files import is_link, is_made_here, is_plain, refuse_link
from acquisition.runs.run_id import after_others, new_run_id
from config.errors import ConfigError, RecordingError, system_errors
from config.formats.bounded_file import read_file
from config.formats.json_file import OTHER_FORMAT, other_format
from config.formats.whole_file import write_whole

_MANIFEST_BYTES = 4_000_000
_READ_BYTES = 200_000_000


@dataclass(frozen=True)
class RunFolder:
    """A run's folder; made by `create`, found again by `open`.

    Attributes:
        path: The folder, resolved.
        run_id: Its generated id.
    """

    path: Path
    run_id: str

    @classmethod
    def create(
        cls,
        root: Path,
        label: str,
        *,
        kind: str = "record",
        software: dict[str, str] | None = None,
        now_ns: int | None = None,
    ) -> RunFolder:
        """Make a new, empty run folder under `root`.

        Args:
            root: Folder of all runs; made where it does not exist.
            label: What people call the run: 1 to 64 letters, digits, spaces, `_`, `.` and `-`.
            kind: Which job makes it: record, import, ...
            software: Names and versions of what makes it.
            now_ns: Time since 1970 [ns]; the computer's if not given.

        Raises:
            ConfigError: The label has other characters, or means another run.
            RecordingError: The folder cannot be made.
        """
        require_label(label)
        created_ns = time.time_ns() if now_ns is None else now_ns
        with system_errors(
            RecordingError, f"{root}: no run folder can be made", code="RID-FILE-WRITE"
        ):
            root.mkdir(parents=True, exist_ok=True)
            run_id = new_run_id(after_others(root, created_ns))
            path = root.resolve() / run_id
            path.mkdir()
        folder = cls(path, run_id)
        folder._save(
            Manifest(
                format=FORMAT,
                run_id=run_id,
                label=label,
                kind=kind,
                status=RunStatus.UNFINISHED,
                created_utc=_utc(created_ns),
                software=software or {},
            )
        )
        return folder

    @classmethod
    def open(cls, path: Path) -> RunFolder:
        """Return the run folder at `path`, wherever it was moved to.

        Raises:
            RecordingError: There is none, or its manifest cannot be read.
        """
        folder = cls(path.resolve(), "")
        return cls(folder.path, folder.manifest().run_id)

    def manifest(self) -> Manifest:
        """Read what the folder says about itself.

        Raises:
            RecordingError: There is no manifest, or it is damaged.
        """
        path = self.path / MANIFEST
        try:
            data = read_file(path, _MANIFEST_BYTES, follow_link=False)
            manifest = Manifest.model_validate_json(data)
        except OSError as error:
            raise RecordingError(
                f"{self.path}: not a run folder: {error}", code="RID-RUN-DAMAGED"
            ) from error
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(str(part) for part in first["loc"])
            raise RecordingError(
                f"{path}: damaged: {where} {first['msg']}", code="RID-RUN-DAMAGED"
            ) from error
        if manifest.format != FORMAT:
            refused = other_format(f"{path}: a run folder", manifest.format, FORMAT)
            raise RecordingError(str(refused), code=OTHER_FORMAT)
        return manifest

    def file(self, name: str) -> Path:
        """Return the path of the file called `name`, which need not exist yet.

        Args:
            name: A plain name, or names joined by `/` for a file in a folder.

        Raises:
            ConfigError: The name is not a plain one.
            RecordingError: A link stands in its way.
        """
        parts = name.split("/")
        if not all(is_plain(part) for part in parts):
            raise ConfigError(
                f"file name {name[:120]!r}: use letters, digits, '_', '.' and '-'",
                code="RID-FILE-NAME",
            )
        path = self.path
        for part in parts:
            path = path / part
            refuse_link(path)
        return path

    def read(self, name: str) -> bytes:
        """Return a file's bytes.

        Raises:
            RecordingError: It cannot be read, is a link, or is not what was written.
        """
        path = self.file(name)
        with system_errors(RecordingError, f"{path}: cannot be read", code="RID-FILE-READ"):
            data = read_file(path, _READ_BYTES, follow_link=False)
        entry = self.manifest().files.get(name)
        if entry is not None and entry.sha256 != hashlib.sha256(data).hexdigest():
            raise RecordingError(
                f"{path}: is not what was written (its SHA-256 differs): put the original back, or"
                " delete the file and repeat the step that made it",
                code="RID-RUN-CHANGED",
            )
        return data

    def holds(self, name: str, entry: FileEntry) -> bool:
        """Return whether a file has the contents that an entry of a manifest says.

        Raises:
            RecordingError: It cannot be read.
        """
        path = self.file(name)
        with system_errors(RecordingError, f"{path}: cannot be read", code="RID-FILE-READ"):
            size = path.lstat().st_size
        return size == entry.size_bytes and digest_of(path) == (entry.sha256, size)

    def differences(self, names: Iterable[str]) -> dict[str, str]:
        """Return which files are not those that the run was made with, and what is wrong.

        Journals of a run that was never finished have no hash yet: they are not compared.

        Args:
            names: Files to compare; those that the run never had and has not now are none.

        Raises:
            RecordingError: The folder cannot be read, or a link stands in it.
        """
        manifest = self.manifest()
        ended = manifest.status in (RunStatus.COMPLETE, RunStatus.STOPPED)
        found = {}
        for name in names:
            path, entry = self.file(name), manifest.files.get(name)
            if entry is None:
                if ended and path.exists():
                    found[name] = "was put into the folder after the run had ended"
            elif not path.exists():
                found[name] = "is missing"
            elif not self.holds(name, entry):
                found[name] = f"is not the file of run {manifest.run_id} (its SHA-256 differs)"
        return found

    def write(self, name: str, data: bytes) -> Path:
        """Write a file whole or not at all, replacing an older one; note it in the manifest.

        Raises:
            ConfigError: The name is not a plain one.
            RecordingError: It cannot be written.
        """
        path = self.file(name)
        if name == MANIFEST:
            raise ConfigError(
                f"{MANIFEST} is written by the run folder itself", code="RID-INTERNAL-ERROR"
            )
        manifest = self._own_manifest()
        self._write(path, data)
        entry = FileEntry(sha256=hashlib.sha256(data).hexdigest(), size_bytes=len(data))
        self._save(manifest.model_copy(update={"files": {**manifest.files, name: entry}}))
        return path

    def finish(
        self,
        status: RunStatus,
        facts: dict[str, JsonValue] | None = None,
        missing: Mapping[str, FileEntry] | None = None,
    ) -> Manifest:
        """Say what became of the run and note the recordings that are in the folder.

        Files that were written before keep the hash that they had then. Strays are left alone.

        Args:
            status: The outcome.
            facts: What a list of runs should show; added to what is there.
            missing: Files that belong to the run and are not there; only they will be taken, later.

        Raises:
            RecordingError: The folder cannot be read or written, or is that of another run by now.
        """
        manifest = self._own_manifest()
        new = [name for name in self._present()[0] if name not in manifest.files]
        files = {name: entry_of(self.file(name)) for name in new if is_made_here(name)}
        finished = manifest.model_copy(
            update={
                "format": FORMAT,
                "status": str(status),
                "finished_utc": _utc(time.time_ns()),
                "facts": {**manifest.facts, **(facts or {})},
                "files": {**(missing or {}), **manifest.files, **files},
            }
        )
        self._save(finished)
        return finished

    def verify(self) -> tuple[str, ...]:
        """Compare every file with the manifest.

        Returns:
            What is wrong, one sentence each; empty for a complete and unchanged run.

        Raises:
            RecordingError: The manifest itself, or the folder, cannot be read.
        """
        manifest = self.manifest()
        problems = []
        if manifest.status == RunStatus.UNFINISHED:
            problems.append("the run was not finished: it is still running, or was killed")
        for name, entry in manifest.files.items():
            try:
                unchanged = self.holds(name, entry)
            except (ConfigError, RecordingError) as error:
                problems.append(f"{name}: {error}")
                continue
            if not unchanged:
                problems.append(f"{name}: is not what was written (its SHA-256 differs)")
        return tuple(problems)

    def strays(self) -> tuple[str, ...]:
        """Return what is in the folder and not in the manifest: left alone, and never read.

        Raises:
            RecordingError: The manifest, or the folder, cannot be read.
        """
        files, others = self._present()
        known = self.manifest().files
        found = {*others, *(name for name in files if name not in known)}
        return tuple(sorted(name.encode(errors="backslashreplace").decode() for name in found))

    def _present(self) -> tuple[list[str], list[str]]:
        """Return the files that may be the run's by their names, and everything else."""
        files: list[str] = []
        others: list[str] = []
        for folder, folders, names in os.walk(self.path, followlinks=False):
            for name in (*folders, *names):
                path = Path(folder) / name
                relative = str(path.relative_to(self.path))
                if relative == MANIFEST or name.endswith(".tmp"):
                    continue
                plain = all(is_plain(part) for part in relative.split("/"))
                if is_link(path) or not plain or not (path.is_file() or name in folders):
                    others.append(relative)
                elif name in names:
                    files.append(relative)
        return sorted(files), others

    def _own_manifest(self) -> Manifest:
        """Read the manifest, which must still be this run's.

        Raises:
            RecordingError: It cannot be read, or another run's folder has taken this one's place.
        """
        manifest = self.manifest()
        if manifest.run_id != self.run_id:
            raise RecordingError(
                f"{self.path}: is the folder of run {manifest.run_id} by now, and nothing was"
                f" written into it. The folder of run {self.run_id} was moved or deleted meanwhile:"
                " put it back, then `rid-daq recover` it",
                code="RID-RUN-REPLACED",
            )
        return manifest

    def _save(self, manifest: Manifest) -> None:
        self._write(self.path / MANIFEST, manifest.model_dump_json(indent=2).encode() + b"\n")

    def _write(self, path: Path, data: bytes) -> None:
        with system_errors(RecordingError, f"{path.parent}: cannot be made", code="RID-FILE-WRITE"):
            path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, data)


def _utc(time_ns: int) -> str:
    return datetime.fromtimestamp(time_ns / 1e9, UTC).isoformat(timespec="milliseconds")
