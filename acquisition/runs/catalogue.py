"""Search for runs: lists the folders below a root at each call, without an index."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import LATEST, MANIFEST, Manifest
from acquisition.runs.run_id import RUN_ID
from config.errors import ConfigError, RecordingError

SHOWN: Final = 5
_LOG = logging.getLogger("rid_daq.runs")


def list_runs(root: Path) -> tuple[tuple[RunFolder, Manifest], ...]:
    """Return the runs below `root`, oldest first.

    Runs with an unreadable manifest, or with the manifest of another run, are left out.
    """
    return tuple(
        (folder, manifest)
        for folder, manifest in _run_folders(root)
        if isinstance(manifest, Manifest)
    )


def list_damaged_runs(root: Path) -> tuple[tuple[RunFolder, RecordingError], ...]:
    """Return the runs below `root` that `list_runs` leaves out, with the error, oldest first."""
    return tuple(
        (folder, manifest)
        for folder, manifest in _run_folders(root)
        if isinstance(manifest, RecordingError)
    )


def _run_folders(root: Path) -> Iterator[tuple[RunFolder, Manifest | RecordingError]]:
    """Yield each folder whose name is a run id."""
    if not root.is_dir():
        return
    for path in sorted(root.resolve().iterdir()):
        if not RUN_ID.fullmatch(path.name) or path.is_symlink():
            continue
        folder = RunFolder(path, path.name)
        try:
            manifest = folder.manifest()
        except RecordingError as error:
            yield folder, error
            continue
        if manifest.run_id == folder.run_id:
            yield folder, manifest
        else:
            yield (
                folder,
                RecordingError(
                    f"{path}: has the manifest of run {manifest.run_id}: give the folder this"
                    " name, or remove it",
                    code="RID-RUN-DAMAGED",
                ),
            )


def unlisted_folders(root: Path) -> tuple[str, ...]:
    """Return the names of folders with a manifest that are links, or whose name is no run id."""
    if not root.is_dir():
        return ()
    return tuple(
        path.name.encode(errors="backslashreplace").decode()
        for path in sorted(root.resolve().iterdir())
        if (path / MANIFEST).is_file() and (path.is_symlink() or not RUN_ID.fullmatch(path.name))
    )


def find_runs(root: Path, references: Iterable[str]) -> tuple[RunFolder, ...]:
    """Return the runs that `references` name; all are different.

    Raises:
        ConfigError: A reference matches no run or several, or two references name the same run or
            its copy.
        RecordingError: See `find_run`.
    """
    found = tuple(find_run(root, reference) for reference in references)
    seen: set[str] = set()
    for folder in found:
        if folder.run_id in seen:
            raise ConfigError(
                f"run {folder.run_id} is named twice, or together with its copy: name each run"
                " once",
                code="RID-OPTION-EXCLUSIVE",
            )
        seen.add(folder.run_id)
    return found


def find_run(root: Path, reference: str, having: tuple[str, ...] = ()) -> RunFolder:
    """Return the run that `reference` names; logs a warning if several runs have that label.

    Args:
        root: Folder of all runs.
        reference: Path of a run folder, `latest`, an id or the unique beginning of an id, or a
            label. The newest run with a label is used.
        having: If given, a label or `latest` matches only runs that contain one of these files.

    Raises:
        ConfigError: No run matches, or the beginning of an id matches several.
        RecordingError: The folder at that path is not a run, or the latest run is damaged.
    """
    if (Path(reference) / MANIFEST).exists():
        return RunFolder.open(Path(reference))
    try:
        return find_run_below(root, reference, having)
    except ConfigError:
        if Path(reference).is_file():
            raise ConfigError(
                f"{reference} is a file, not a run: name a run by its label or id, or make a run"
                " from a recording with `rid-daq import`",
                code="RID-RUN-IS-FILE",
            ) from None
        raise


def find_run_below(root: Path, reference: str, having: tuple[str, ...] = ()) -> RunFolder:
    """Return the run below `root` that `reference` names; the reference cannot be a path.

    Arguments and errors are those of `find_run`.
    """
    runs = list_runs(root)
    fit = [
        each for each in runs if not having or any(each[0].file(name).exists() for name in having)
    ]
    if reference == LATEST and fit:
        for folder, problem in list_damaged_runs(root):
            if folder.run_id > fit[-1][0].run_id:
                raise RecordingError(
                    f"the latest run is damaged: {problem}; name another run by its id",
                    code="RID-RUN-DAMAGED",
                )
        return fit[-1][0]
    labelled = [each for each in fit if each[1].label == reference]
    if len(labelled) > 1:
        _LOG.warning("%s", _ambiguous_label_warning(reference, labelled))
    if labelled:
        return labelled[-1][0]
    meant = [each for each in runs if reference and each[0].run_id.startswith(reference.upper())]
    if len(meant) == 1:
        return meant[0][0]
    if meant:
        which = ", ".join(map(_describe_run, meant[-SHOWN:]))
        raise ConfigError(
            f"run {reference!r} is ambiguous: {which}: give more characters of the id",
            code="RID-RUN-AMBIGUOUS",
        )
    what = f"run with {' or '.join(having)}" if having else "run"
    raise ConfigError(
        f"no {what} {reference!r} under {root}: `rid-daq runs` lists them", code="RID-RUN-UNKNOWN"
    )


def find_file_or_run(root: Path, reference: str, having: tuple[str, ...] = ()) -> Path | RunFolder:
    """Return the file `reference` if it exists, else the run that `reference` names.

    Args:
        root, reference, having: See `find_run`; a label may look like a file name.

    Raises:
        ConfigError, RecordingError: The file does not exist, and `find_run` raises this error.
    """
    path = Path(reference)
    if path.is_file():
        return path
    try:
        return find_run(root, reference, having)
    except ConfigError as error:
        raise ConfigError(
            f"{reference}: the file does not exist, and {error}", code=error.refusal
        ) from None


def _ambiguous_label_warning(label: str, labelled: Sequence[tuple[RunFolder, Manifest]]) -> str:
    *others, newest = labelled
    older = ", ".join(map(_describe_run, reversed(others[-SHOWN:])))
    more = len(others) - SHOWN
    older += f" and {more} more" if more > 0 else ""
    return (
        f"{len(labelled)} runs have the label {label!r}: using the newest, {_describe_run(newest)};"
        f" older: {older}"
    )


def _describe_run(run: tuple[RunFolder, Manifest]) -> str:
    folder, manifest = run
    return f"{folder.run_id} ({manifest.created_utc[:16].replace('T', ' ')} UTC)"
