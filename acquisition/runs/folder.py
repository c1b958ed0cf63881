"""`RunFolder`: one folder with all files of a run, complete and portable.

`manifest.json` lists each file of the run with its SHA-256.
Except recordings and logs, which grow during the motion, files are written completely or not at
all. The id is generated and the label is only text: neither can name a place outside the folder.
Files that other programs put into the folder are strays: the program does not use or change them.
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
    file_entry,
    hash_file,
    require_label,
)
from acquisition.runs.run_files import (
    is_link,
    is_plain_name,
    is_written_by_program,
    require_no_link,
)
from acquisition.runs.run_id import new_run_id, time_after_existing_runs
from config.errors import ConfigError, RecordingError, system_errors
from config.formats.bounded_file import read_file
from config.formats.json_file import OTHER_FORMAT, other_format
from config.formats.whole_file import write_whole
from config.wrong_value import explain_error

_MANIFEST_BYTES = 4_000_000
_READ_BYTES = 200_000_000


@dataclass(frozen=True)
class RunFolder:
    """Folder of a run; create it with `create`, open it again with `open`.

    Attributes:
        path: The folder, resolved.
        run_id: Generated id of the run.
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
        facts: Mapping[str, JsonValue] | None = None,
        now_ns: int | None = None,
    ) -> RunFolder:
        """Create a new, empty run folder below `root`.

        Args:
            root: Folder of all runs; it is created if it does not exist.
            label: Label of the run for users: 1 to 64 letters, digits, spaces, `_`, `.` and `-`.
            kind: Job that makes the run: record, import, ...
            software: Names and versions of the software that makes the run.
            facts: Facts for lists of runs that are known before the run ends.
            now_ns: Time since 1970 [ns]; default: the computer's time.

        Raises:
            ConfigError: The label has other characters, or is reserved.
            RecordingError: The folder cannot be created.
        """
        require_label(label)
        created_ns = time.time_ns() if now_ns is None else now_ns
        with system_errors(
            RecordingError, f"{root}: cannot create a run folder", code="RID-FILE-WRITE"
        ):
            root.mkdir(parents=True, exist_ok=True)
            run_id = new_run_id(time_after_existing_runs(root, created_ns))
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
                created_utc=_format_utc(created_ns),
                software=software or {},
                facts=dict(facts or {}),
            )
        )
        return folder

    @classmethod
    def open(cls, path: Path) -> RunFolder:
        """Return the run folder at `path`; the folder may have been moved since the run.

        Raises:
            RecordingError: The folder does not exist, or its manifest cannot be read.
        """
        folder = cls(path.resolve(), "")
        return cls(folder.path, folder.manifest().run_id)

    def manifest(self) -> Manifest:
        """Read the manifest.

        Raises:
            RecordingError: The manifest is missing or damaged.
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
                f"{path}: damaged: {where} {explain_error(first)}", code="RID-RUN-DAMAGED"
            ) from error
        if manifest.format != FORMAT:
            refused = other_format(f"{path}: a run folder", manifest.format, FORMAT)
            raise RecordingError(str(refused), code=OTHER_FORMAT)
        return manifest

    def file(self, name: str) -> Path:
        """Return the path of the file `name`, which need not exist yet.

        Args:
            name: A valid name (`is_plain_name`), or valid names joined by `/` for a file in a
                subfolder.

        Raises:
            ConfigError: The name is invalid.
            RecordingError: A part of the path is a link.
        """
        parts = name.split("/")
        if not all(is_plain_name(part) for part in parts):
            raise ConfigError(
                f"file name {name[:120]!r}: use letters, digits, '_', '.' and '-'",
                code="RID-FILE-NAME",
            )
        path = self.path
        for part in parts:
            path = path / part
            require_no_link(path)
        return path

    def read(self, name: str) -> bytes:
        """Return the contents of a file.

        Raises:
            RecordingError: The file cannot be read, is a link, or has changed since the run was
                made.
        """
        path = self.file(name)
        with system_errors(RecordingError, f"{path}: cannot be read", code="RID-FILE-READ"):
            data = read_file(path, _READ_BYTES, follow_link=False)
        entry = self.manifest().files.get(name)
        if entry is not None and entry.sha256 != hashlib.sha256(data).hexdigest():
            raise RecordingError(
                f"{path}: the file has changed since it was written (its SHA-256 differs):"
                " restore the original, or delete the file and repeat the step that made it",
                code="RID-RUN-CHANGED",
            )
        return data

    def is_unchanged(self, name: str, entry: FileEntry) -> bool:
        """Return True if a file has the size and hash of an entry of the manifest.

        Raises:
            RecordingError: The file cannot be read.
        """
        path = self.file(name)
        with system_errors(RecordingError, f"{path}: cannot be read", code="RID-FILE-READ"):
            size = path.lstat().st_size
        return size == entry.size_bytes and hash_file(path) == (entry.sha256, size)

    def find_changes(self, names: Iterable[str]) -> dict[str, str]:
        """Return the files that differ from those of the run, each with the difference.

        Journals of an unfinished run have no hash yet and are not compared.

        Args:
            names: Files to compare; a file that is neither in the manifest nor in the folder is
                ignored.

        Raises:
            RecordingError: The folder cannot be read, or contains a link.
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
            elif not self.is_unchanged(name, entry):
                found[name] = f"is not the file of run {manifest.run_id} (its SHA-256 differs)"
        return found

    def write(
        self,
        name: str,
        data: bytes | Iterable[bytes],
        facts: Mapping[str, JsonValue] | None = None,
    ) -> Path:
        """Write or replace a file, completely or not at all, and enter it in the manifest.

        Args:
            name: Name of the file.
            data: Its contents, or pieces of them.
            facts: Facts for lists of runs that follow from the file; they are added to the
                existing ones, or replace them.

        Raises:
            ConfigError: The name is invalid.
            RecordingError: The file cannot be written.
        """
        path = self.file(name)
        if name == MANIFEST:
            raise ConfigError(
                f"{MANIFEST} is written by the run folder only", code="RID-INTERNAL-ERROR"
            )
        manifest = self._read_own_manifest()
        sha256, size_bytes = self._write(path, data)
        entry = FileEntry(sha256=sha256, size_bytes=size_bytes)
        new = {
            "files": {**manifest.files, name: entry},
            "facts": {**manifest.facts, **(facts or {})},
        }
        self._save(manifest.model_copy(update=new))
        return path

    def finish(
        self,
        status: RunStatus,
        facts: dict[str, JsonValue] | None = None,
        missing: Mapping[str, FileEntry] | None = None,
    ) -> Manifest:
        """Record the outcome of the run, and enter the recordings and logs of the run's processes.

        Files that are already in the manifest keep their hash. Files whose names this program does
        not use are ignored.

        Args:
            status: The outcome.
            facts: Facts for lists of runs; they are added to the existing ones.
            missing: Files that belong to the run but are missing; only files with these hashes can
                be added later.

        Raises:
            RecordingError: The folder cannot be read or written, or now belongs to another run.
        """
        manifest = self._read_own_manifest()
        new = [name for name in self._list_contents()[0] if name not in manifest.files]
        files = {name: file_entry(self.file(name)) for name in new if is_written_by_program(name)}
        finished = manifest.model_copy(
            update={
                "format": FORMAT,
                "status": str(status),
                "finished_utc": _format_utc(time.time_ns()),
                "facts": {**manifest.facts, **(facts or {})},
                "files": {**(missing or {}), **manifest.files, **files},
            }
        )
        self._save(finished)
        return finished

    def verify(self, read: Iterable[str] = ()) -> tuple[str, ...]:
        """Compare every file in the manifest with its entry.

        Args:
            read: Files that must not be in the folder of an ended run without an entry.

        Returns:
            The problems, one sentence each; empty if the run is complete and unchanged.

        Raises:
            RecordingError: The manifest or the folder cannot be read.
        """
        manifest = self.manifest()
        problems = []
        if manifest.status == RunStatus.UNFINISHED:
            problems.append(
                "the run is not finished: it is still running, or its program was killed"
            )
        elif not manifest.files:
            problems.append(f"{MANIFEST}: lists no files, so nothing can be verified")
        unlisted = [name for name in read if name not in manifest.files]
        problems += [f"{name}: {what}" for name, what in self.find_changes(unlisted).items()]
        for name, entry in manifest.files.items():
            try:
                unchanged = self.is_unchanged(name, entry)
            except (ConfigError, RecordingError) as error:
                problems.append(f"{name}: {error}")
                continue
            if not unchanged:
                problems.append(
                    f"{name}: the file has changed since it was written (its SHA-256 differs)"
                )
        return tuple(problems)

    def strays(self) -> tuple[str, ...]:
        """Return the names in the folder that are not in the manifest; the program ignores them.

        Raises:
            RecordingError: The manifest or the folder cannot be read.
        """
        files, others = self._list_contents()
        known = self.manifest().files
        found = {*others, *(name for name in files if name not in known)}
        return tuple(sorted(name.encode(errors="backslashreplace").decode() for name in found))

    def _list_contents(self) -> tuple[list[str], list[str]]:
        """Return the files whose names are valid in a run, and everything else in the folder."""
        files: list[str] = []
        others: list[str] = []
        for folder, folders, names in os.walk(self.path, followlinks=False):
            for name in (*folders, *names):
                path = Path(folder) / name
                relative = str(path.relative_to(self.path))
                if relative == MANIFEST or name.endswith(".tmp"):
                    continue
                plain = all(is_plain_name(part) for part in relative.split("/"))
                if is_link(path) or not plain or not (path.is_file() or name in folders):
                    others.append(relative)
                elif name in names:
                    files.append(relative)
        return sorted(files), others

    def _read_own_manifest(self) -> Manifest:
        """Read the manifest; it must belong to this run.

        Raises:
            RecordingError: The manifest cannot be read, or another run's folder is at this path.
        """
        manifest = self.manifest()
        if manifest.run_id != self.run_id:
            raise RecordingError(
                f"{self.path}: now contains run {manifest.run_id}; nothing was written. The"
                f" folder of run {self.run_id} was moved or deleted: put it back and run `rid-daq"
                " recover`",
                code="RID-RUN-REPLACED",
            )
        return manifest

    def _save(self, manifest: Manifest) -> None:
        self._write(self.path / MANIFEST, manifest.model_dump_json(indent=2).encode() + b"\n")

    def _write(self, path: Path, data: bytes | Iterable[bytes]) -> tuple[str, int]:
        with system_errors(
            RecordingError, f"{path.parent}: cannot be created", code="RID-FILE-WRITE"
        ):
            path.parent.mkdir(parents=True, exist_ok=True)
        return write_whole(path, data)


def _format_utc(time_ns: int) -> str:
    return datetime.fromtimestamp(time_ns / 1e9, UTC).isoformat(timespec="milliseconds")
