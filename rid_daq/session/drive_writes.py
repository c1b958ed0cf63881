"""Write logs of commands that write to drives: their folder, and how a user names a write log."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Final

from acquisition.runs.catalogue import find_run
from acquisition.runs.run_id import new_run_id
from config.errors import ConfigError
from drivers.settings.saved_drive import SavedDrive
from drivers.settings.write_log import DRIVE_WRITES, WriteLog, read_write_log

FOLDER: Final = "drive_writes"


def new_write_log(runs: Path) -> WriteLog:
    """Return a write log for a command that makes no run, in a folder next to the run folders."""
    return WriteLog(runs / FOLDER / f"{new_run_id(time.time_ns())}.jsonl")


def settings_before_writes(runs: Path, reference: str) -> tuple[SavedDrive, ...]:
    """Return the drives' settings before a run, or before the command of a write log.

    Args:
        runs: Folder of all runs.
        reference: A run as commands name it, even an unfinished one; or the path of a write log.

    Raises:
        ConfigError: There is no such run, it wrote nothing to drives, or its write log is damaged.
        RecordingError: The run folder cannot be read.
    """
    path = Path(reference)
    if path.suffix != ".jsonl":
        folder = find_run(runs, reference)
        path = folder.file(DRIVE_WRITES)
        if not path.exists():
            raise ConfigError(
                f"{folder.path}: this run wrote nothing to drives, so there is nothing to restore",
                code="RID-WRITE-LOG-EMPTY",
            )
    return read_write_log(path)
