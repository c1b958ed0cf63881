"""`RunFolder`: everything about one run in one folder, complete and portable.

`manifest.json` names every file with its SHA-256. Files are written whole or not at all. The id is
generated, the label is text: neither can lead outside the folder.
"""

from __future__ import annotations

import hashlib
import os
import re
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path

from pydantic import Field, JsonValue, ValidationError

from acquisition.run_id import RUN_ID, new_run_id, time_of_run_id
from config.bounded_file import read_file
from config.errors import ConfigError, RecordingError
from config.model import ConfigModel
from config.whole_file import write_whole

LATEST = "latest"
MANIFEST = "manifest.json"
RECORDING = "recording.mcap"
FORMAT = 1
CLOCK_STEP_NS = 24 * 3600 * 10**9  # a clock set back by more was wrong before

_LABEL = re.compile(r"[\w .-]{1,64}")
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}")
_DEVICE = re.compile(r"(?:con|prn|aux|nul|com\d|lpt\d)(?:\..*)?", re.IGNORECASE)
_MANIFEST_BYTES = 4_000_000
_READ_BYTES = 200_000_000


class RunStatus(StrEnum):
    """What became of a run."""

    UNFINISHED = "unfinished"
    COMPLETE = "complete"
    STOPPED = "stopped"
    RECOVERED = "recovered"


class FileEntry(ConfigModel):
    """One file of a run."""

    sha256: str
    size_bytes: int


class Manifest(ConfigModel):
    """What a run folder says about itself."""

    format: int
    run_id: str
    label: str
    kind: str
    status: str
    created_utc: str
    finished_utc: str | None = None
    software: dict[str, str] = Field(default_factory=dict)
    facts: dict[str, JsonValue] = Field(default_factory=dict)
    files: dict[str, FileEntry] = Field(default_factory=dict)


@dataclass(frozen=True)
class RunFolder:
    """A run's folder; made by `create`, found again by `open`.

    Attributes
    ----------
    path : Path
        The folder, resolved.
    run_id : str
        Its generated id.
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

        Parameters
        ----------
        root : Path
            Folder of all runs; made where it does not exist.
        label : str
            What people call the run: 1 to 64 letters, digits, spaces, `_`, `.` and `-`.
        kind : str
            Which job makes it: record, import, ...
        software : dict
            Names and versions of what makes it.
        now_ns : int, optional
            Time since 1970 [ns]; the computer's if not given.

        Raises
        ------
        ConfigError
            The label has other characters, or means another run.
        RecordingError
            The folder cannot be made.
        """
        require_label(label)
        created_ns = time.time_ns() if now_ns is None else now_ns
        try:
            root.mkdir(parents=True, exist_ok=True)
            run_id = new_run_id(_after_others(root, created_ns))
            path = root.resolve() / run_id
            path.mkdir()
        except OSError as error:
            raise RecordingError(f"{root}: no run folder can be made: {error.strerror}") from error
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

        Raises
        ------
        RecordingError
            There is none, or its manifest cannot be read.
        """
        folder = cls(path.resolve(), "")
        return cls(folder.path, folder.manifest().run_id)

    def manifest(self) -> Manifest:
        """Read what the folder says about itself.

        Raises
        ------
        RecordingError
            There is no manifest, or it is damaged.
        """
        path = self.path / MANIFEST
        try:
            data = read_file(path, _MANIFEST_BYTES, follow_link=False)
            manifest = Manifest.model_validate_json(data)
        except OSError as error:
            raise RecordingError(f"{self.path}: not a run folder: {error}") from error
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(str(part) for part in first["loc"])
            raise RecordingError(f"{path}: damaged: {where} {first['msg']}") from error
        if manifest.format != FORMAT:
            raise RecordingError(
                f"{path}: format {manifest.format}, this program reads {FORMAT}: use a newer one"
            )
        return manifest

    def file(self, name: str) -> Path:
        """Return the path of the file called `name`, which need not exist yet.

        Parameters
        ----------
        name : str
            A plain name, or names joined by `/` for a file in a folder.

        Raises
        ------
        ConfigError
            The name is not a plain one.
        RecordingError
            A link stands in its way.
        """
        parts = name.split("/")
        for part in parts:
            if not _NAME.fullmatch(part) or _DEVICE.fullmatch(part) or part.endswith("."):
                raise ConfigError(
                    f"file name {name[:120]!r}: use letters, digits, '_', '.' and '-'"
                )
        path = self.path
        for part in parts:
            path = path / part
            _refuse_link(path)
        return path

    def read(self, name: str) -> bytes:
        """Return a file's bytes.

        Raises
        ------
        RecordingError
            It cannot be read, or is a link.
        """
        path = self.file(name)
        try:
            return read_file(path, _READ_BYTES, follow_link=False)
        except OSError as error:
            raise RecordingError(f"{path}: cannot be read: {error.strerror}") from error

    def write(self, name: str, data: bytes) -> Path:
        """Write a file whole or not at all, replacing an older one; note it in the manifest.

        Raises
        ------
        ConfigError
            The name is not a plain one.
        RecordingError
            It cannot be written.
        """
        path = self.file(name)
        if name == MANIFEST:
            raise ConfigError(f"{MANIFEST} is written by the run folder itself")
        manifest = self.manifest()
        self._write(path, data)
        entry = FileEntry(sha256=hashlib.sha256(data).hexdigest(), size_bytes=len(data))
        self._save(manifest.model_copy(update={"files": {**manifest.files, name: entry}}))
        return path

    def finish(self, status: RunStatus, facts: dict[str, JsonValue] | None = None) -> Manifest:
        """Say what became of the run and note every file that is in the folder.

        Parameters
        ----------
        status : RunStatus
            The outcome.
        facts : dict, optional
            What a list of runs should show; added to what is there.

        Raises
        ------
        RecordingError
            The folder cannot be read or written.
        """
        manifest = self.manifest()
        files = {name: _entry(self.file(name)) for name in self._present()}
        finished = manifest.model_copy(
            update={
                "status": str(status),
                "finished_utc": _utc(time.time_ns()),
                "facts": {**manifest.facts, **(facts or {})},
                "files": files,
            }
        )
        self._save(finished)
        return finished

    def verify(self) -> tuple[str, ...]:
        """Compare every file with the manifest.

        Returns
        -------
        tuple of str
            What is wrong, one sentence each; empty for a complete and unchanged run.

        Raises
        ------
        RecordingError
            The manifest itself cannot be read.
        """
        manifest = self.manifest()
        problems = []
        if manifest.status == RunStatus.UNFINISHED:
            problems.append("the run was not finished: it is still running, or was killed")
        present = set()
        try:
            present = set(self._present())
        except RecordingError as error:
            problems.append(str(error))
        for name, entry in manifest.files.items():
            try:
                found = _entry(self.file(name))
            except (ConfigError, RecordingError) as error:
                problems.append(f"{name}: {error}")
                continue
            if found != entry:
                problems.append(f"{name}: is not what was written (its SHA-256 differs)")
        extra = sorted(present - manifest.files.keys())
        problems += [f"{name}: is not in the manifest" for name in extra]
        return tuple(problems)

    def _present(self) -> list[str]:
        names = []
        for folder, folders, files in os.walk(self.path, followlinks=False):
            for name in (*folders, *files):
                _refuse_link(Path(folder) / name)
            names += [str((Path(folder) / name).relative_to(self.path)) for name in files]
        return sorted(name for name in names if name != MANIFEST and not name.endswith(".tmp"))

    def _save(self, manifest: Manifest) -> None:
        self._write(self.path / MANIFEST, manifest.model_dump_json(indent=2).encode() + b"\n")

    def _write(self, path: Path, data: bytes) -> None:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RecordingError(f"{path.parent}: cannot be made: {error.strerror}") from error
        write_whole(path, data)


def require_label(label: str) -> None:
    """Refuse what no run can be called.

    Raises
    ------
    ConfigError
        It has other characters, or means another run.
    """
    if not _LABEL.fullmatch(label) or label == LATEST:
        raise ConfigError(
            f"label {label[:80]!r}: use 1 to 64 letters, digits, spaces, '_', '.' and '-', and"
            f" not {LATEST!r}, which means the newest run"
        )


def _refuse_link(path: Path) -> None:
    try:
        is_link = path.is_symlink()
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from error
    if is_link:
        raise RecordingError(f"{path}: is a symbolic link; a run folder has none")


def _entry(path: Path) -> FileEntry:
    digest = hashlib.sha256()
    size = 0
    try:
        with open(os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK), "rb") as file:
            while block := file.read(1 << 20):
                digest.update(block)
                size += len(block)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from error
    return FileEntry(sha256=digest.hexdigest(), size_bytes=size)


def _after_others(root: Path, now_ns: int) -> int:
    """Return a time for an id that sorts after those under `root`, the clock set back or not."""
    ids = [name for name in os.listdir(root) if RUN_ID.fullmatch(name)]
    newest_ns = time_of_run_id(max(ids)) if ids else 0
    behind_ns = newest_ns - now_ns
    return newest_ns + 1_000_000 if 0 <= behind_ns + 1_000_000 <= CLOCK_STEP_NS else now_ns


def _utc(time_ns: int) -> str:
    return datetime.fromtimestamp(time_ns / 1e9, UTC).isoformat(timespec="milliseconds")
