"""Names and links of the files in a run folder."""

from __future__ import annotations

import re
from pathlib import Path

from acquisition.runs.manifest import JOURNAL
from acquisition.runs.run_id import RUN_ID
from config.errors import RecordingError, system_errors

_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}")
_DEVICE = re.compile(r"(?:con|prn|aux|nul|com\d|lpt\d)(?:\..*)?", re.IGNORECASE)
_NOT_BY_WRITE = (
    JOURNAL,
    ".blf",
    ".json",
    ".jsonl",
)  # what recorders and estimators put in by themselves


def is_plain(name: str) -> bool:
    """Return True if a name can be that of a file on every system."""
    return bool(_NAME.fullmatch(name)) and not _DEVICE.fullmatch(name) and not name.endswith(".")


def is_made_here(name: str) -> bool:
    """Return True if the program itself puts such files into a run, or into a run inside it."""
    return name.endswith(_NOT_BY_WRITE) or any(map(RUN_ID.fullmatch, name.split("/")[:-1]))


def refuse_link(path: Path) -> None:
    """Raise `RecordingError` if a path is a symbolic link."""
    if is_link(path):
        raise RecordingError(
            f"{path}: is a symbolic link; a run folder has none", code="RID-RUN-LINK"
        )


def is_link(path: Path) -> bool:
    """Return True if a path is a symbolic link; raise `RecordingError` if it cannot be read."""
    with system_errors(RecordingError, f"{path}: cannot be read", code="RID-FILE-READ"):
        return path.is_symlink()
