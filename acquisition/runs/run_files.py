"""Names of the files in a run folder, and checks for links."""

from __future__ import annotations

import re
from pathlib import Path

from acquisition.runs.manifest import JOURNAL
from acquisition.runs.run_id import RUN_ID
from config.errors import RecordingError, system_errors

_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}")
_DEVICE = re.compile(r"(?:con|prn|aux|nul|com\d|lpt\d)(?:\..*)?", re.IGNORECASE)
# Endings of files that recorders and estimators write without `RunFolder.write`.
_NOT_BY_WRITE = (JOURNAL, ".blf", ".json", ".jsonl")


def is_plain_name(name: str) -> bool:
    """Return True if `name` is a valid file name on every operating system."""
    return bool(_NAME.fullmatch(name)) and not _DEVICE.fullmatch(name) and not name.endswith(".")


def is_written_by_program(name: str) -> bool:
    """Return True for an ending with which this program writes files, or a file of a nested run."""
    return name.endswith(_NOT_BY_WRITE) or any(map(RUN_ID.fullmatch, name.split("/")[:-1]))


def require_no_link(path: Path) -> None:
    """Raise `RecordingError` if `path` is a symbolic link."""
    if is_link(path):
        raise RecordingError(
            f"{path}: is a symbolic link; replace it by the file, since a run folder cannot"
            " contain links",
            code="RID-RUN-LINK",
        )


def is_link(path: Path) -> bool:
    """Return True if `path` is a symbolic link; raise `RecordingError` if it cannot be read."""
    with system_errors(RecordingError, f"{path}: cannot be read", code="RID-FILE-READ"):
        return path.is_symlink()
