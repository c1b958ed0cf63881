"""`Manifest`: description of a run and of each of its files."""

from __future__ import annotations

import hashlib
import os
import re
from enum import StrEnum
from pathlib import Path

from pydantic import Field, JsonValue

from acquisition.journal.mcap_reader import messages_written
from config.errors import ConfigError, RecordingError, system_errors
from config.model import ConfigModel

LATEST = "latest"
MANIFEST = "manifest.json"
RECORDING = "recording.mcap"
JOURNAL = ".mcap"
FORMAT = 2

_LABEL = re.compile(r"[\w .-]{1,64}")


class RunStatus(StrEnum):
    """Outcome of a run."""

    UNFINISHED = "unfinished"
    COMPLETE = "complete"
    STOPPED = "stopped"
    RECOVERED = "recovered"


class FileEntry(ConfigModel):
    """One file of a run; `rows` is the number of rows of a closed recording at the run's end."""

    sha256: str
    size_bytes: int
    rows: int | None = None


class Manifest(ConfigModel):
    """Contents of a run folder's `manifest.json`."""

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


def require_label(label: str) -> None:
    """Raise an error if `label` cannot be a label of a run.

    Raises:
        ConfigError: The label has invalid characters or a wrong length, or is reserved.
    """
    if not _LABEL.fullmatch(label) or label == LATEST:
        raise ConfigError(
            f"invalid label {label[:80]!r}: use 1 to 64 letters, digits, spaces, '_', '.' and"
            f" '-', but not {LATEST!r}, which means the newest run",
            code="RID-FILE-NAME",
        )


def file_entry(path: Path) -> FileEntry:
    """Return the manifest entry of a file.

    Raises:
        RecordingError: The file cannot be read.
    """
    sha256, size_bytes = hash_file(path)
    rows = messages_written(path) if path.suffix == JOURNAL else None
    return FileEntry(sha256=sha256, size_bytes=size_bytes, rows=rows)


def hash_file(path: Path) -> tuple[str, int]:
    """Return SHA-256 and size of a file.

    Raises:
        RecordingError: The file cannot be read.
    """
    digest = hashlib.sha256()
    size = 0
    with (
        system_errors(RecordingError, f"{path}: cannot be read", code="RID-FILE-READ"),
        open(os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK), "rb") as file,
    ):
        while block := file.read(1 << 20):
            digest.update(block)
            size += len(block)
    return digest.hexdigest(), size
