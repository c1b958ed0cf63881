"""Output file of an operation: refuse an unsuitable path before anything is computed."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import MANIFEST
from acquisition.runs.run_id import RUN_ID
from config.errors import ConfigError, RecordingError, system_errors
from config.formats.whole_file import write_whole
from rid_daq.runs.made_file import MadeFile

_RESULTS: Final = (".json", ".pdf", ".html")


def refuse_output(output: Path | None, overwrite: bool, made: MadeFile) -> None:
    """Refuse an output file that cannot be written or must not be replaced.

    Args:
        output: The file; None (always accepted) if the result is stored in a run.
        overwrite: True if an existing file can be replaced; of a run, only results can.
        made: Kind of the file; only a file of this kind that rid-daq wrote is replaced.

    Raises:
        ConfigError: The file exists already, is of another kind, or belongs to a run.
        RecordingError: A file of this name cannot be written, or the existing file cannot be read.
    """
    if output is None:
        return
    if output.exists() and output.is_file():
        if not overwrite:
            raise ConfigError(
                f"{output}: the file exists already; give another name, or overwrite it"
                " (`--overwrite`; in Python `overwrite=True`)",
                code="RID-OUTPUT-EXISTS",
            )
        _refuse_part_of_run(output)
        with system_errors(
            RecordingError, f"{output}: the file cannot be read", code="RID-FILE-READ"
        ):
            is_own = made.is_at(output)
        if not is_own:
            raise ConfigError(
                f"{output}: the file is not {made.words} of rid-daq, so it is not replaced:"
                " delete it yourself, or give another name",
                code="RID-OUTPUT-FOREIGN",
            )
    require_writable(output)


def require_writable(output: Path) -> None:
    """Refuse a file that cannot be written, or that is a part of a run.

    Raises:
        ConfigError: The file belongs to a run.
        RecordingError: A file of this name cannot be written.
    """
    if output.exists() and not output.is_file():
        raise RecordingError(
            f"{output}: cannot be written, because it is not a regular file; choose another name",
            code="RID-FILE-WRITE",
        )
    if not output.parent.is_dir():
        raise RecordingError(
            f"{output}: cannot be written: folder {output.parent} does not exist",
            code="RID-FILE-WRITE",
        )
    if not os.access(output.parent, os.W_OK | os.X_OK):
        raise RecordingError(
            f"{output}: cannot be written: no write permission for {output.parent}",
            code="RID-FILE-WRITE",
        )
    _refuse_part_of_run(output)


def write_new_files(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files into a folder, which is made if it is missing; replace nothing.

    Raises:
        ConfigError: One of the files exists already; nothing was written.
        RecordingError: The folder or a file cannot be written.
    """
    refuse_present(folder, files)
    where = f"{folder}: cannot make the folder"
    with system_errors(RecordingError, where, code="RID-FILE-WRITE"):
        folder.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        write_whole(folder / name, content)


def refuse_present(folder: Path, names: Iterable[str]) -> None:
    """Refuse a folder that contains one of these files.

    Raises:
        ConfigError: One of the files exists (RID-FILE-EXISTS).
    """
    present = [name for name in names if (folder / name).exists()]
    if present:
        raise ConfigError(
            f"{folder}: {', '.join(present)} exists already; nothing was written. Give another"
            " folder, or move the files away.",
            code="RID-FILE-EXISTS",
        )


def _refuse_part_of_run(output: Path) -> None:
    """Refuse to overwrite a file of a run, except results that its manifest lists."""
    path = output.resolve()
    folder = next((each for each in path.parents if (each / MANIFEST).is_file()), None)
    if folder is None:
        return
    # imported late: these modules import all readers of runs
    from rid_daq.report.result_file import REPORT, RESULT
    from rid_daq.runs.run_data import READ, SESSION

    parts = (*READ, SESSION, RESULT, REPORT, MANIFEST)
    name = path.relative_to(folder).as_posix()
    try:
        manifest = RunFolder.open(folder).manifest()
        run_id, files = manifest.run_id, set(manifest.files)
    except RecordingError:
        if not RUN_ID.fullmatch(folder.name):
            return  # another program has written this manifest
        run_id, files = folder.name, set()
    if name in parts or (name in files and not name.endswith(_RESULTS)):
        raise ConfigError(
            f"{output}: belongs to run {run_id} and cannot be replaced by a result: give another"
            " name",
            code="RID-OUTPUT-RUN",
        )


def register_output(folder: RunFolder, output: Path) -> None:
    """Add an output file to the manifest, if it is in the run's folder.

    Raises:
        RecordingError: The file cannot be added.
    """
    if output.resolve().parent == folder.path.resolve():
        with system_errors(RecordingError, f"{output}: cannot be read", code="RID-FILE-READ"):
            content = output.read_bytes()
        with contextlib.suppress(ConfigError):  # the name is not allowed for a run's file
            folder.write(output.name, content)
