"""The file that a user names for a result: refused, if it must be, before anything is computed."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import MANIFEST
from acquisition.runs.run_id import RUN_ID
from config.errors import ConfigError, RecordingError, system_errors
from rid_daq.runs.made_file import MadeFile

_RESULTS: Final = (".json", ".pdf", ".html")


def refuse_output(output: Path | None, overwrite: bool, made: MadeFile) -> None:
    """Refuse a file that cannot be written, or that was not meant to be replaced.

    Args:
        output: The file; None, which is never refused, where the result has its place in a run.
        overwrite: Whether a file that is there may be replaced; a part of a run may never be.
        made: What is written: only such a file that rid-daq wrote is replaced.

    Raises:
        ConfigError: A file of that name is there, or belongs to a run.
        RecordingError: No file of that name can be.
    """
    if output is None:
        return
    if output.exists() and output.is_file():
        if not overwrite:
            raise ConfigError(
                f"{output}: is already there; give another name, or --overwrite",
                code="RID-OUTPUT-EXISTS",
            )
        _refuse_part(output)
        with system_errors(RecordingError, f"{output}: cannot be read", code="RID-FILE-READ"):
            is_own = made.is_at(output)
        if not is_own:
            raise ConfigError(
                f"{output}: is not {made.words} of rid-daq, so it is not replaced: delete it"
                " yourself, or give another name",
                code="RID-OUTPUT-FOREIGN",
            )
    require_writable(output)


def require_writable(output: Path) -> None:
    """Refuse a file that cannot be written, or that is a part of a run.

    Raises:
        ConfigError: It belongs to a run.
        RecordingError: No file of that name can be.
    """
    if output.exists() and not output.is_file():
        raise RecordingError(
            f"{output}: cannot be written: is no file; choose another name", code="RID-FILE-WRITE"
        )
    if not output.parent.is_dir():
        raise RecordingError(
            f"{output}: cannot be written: there is no folder {output.parent}",
            code="RID-FILE-WRITE",
        )
    if not os.access(output.parent, os.W_OK | os.X_OK):
        raise RecordingError(
            f"{output}: cannot be written: {output.parent} may not be written to",
            code="RID-FILE-WRITE",
        )
    _refuse_part(output)


def _refuse_part(output: Path) -> None:
    """Refuse what a run is made of, and what its manifest names besides results."""
    path = output.resolve()
    folder = next((each for each in path.parents if (each / MANIFEST).is_file()), None)
    if folder is None:
        return
    from rid_daq.report.result_file import REPORT, RESULT
    from rid_daq.runs.run_data import READ, SESSION  # they load all that reads a run

    parts = (*READ, SESSION, RESULT, REPORT, MANIFEST)
    name = path.relative_to(folder).as_posix()
    try:
        manifest = RunFolder.open(folder).manifest()
        run_id, files = manifest.run_id, set(manifest.files)
    except RecordingError:
        if not RUN_ID.fullmatch(folder.name):
            return  # another program's
        run_id, files = folder.name, set()
    if name in parts or (name in files and not name.endswith(_RESULTS)):
        raise ConfigError(
            f"{output}: is a part of run {run_id}, which a result cannot replace:"
            " give another name",
            code="RID-OUTPUT-RUN",
        )
