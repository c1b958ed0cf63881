"""Finding runs: the folders under a root are the truth, an index is not needed."""

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
    """Return the runs under `root`, oldest first; what is not a readable run is left out."""
    return tuple(
        (folder, manifest)
        for folder, manifest in _runs(root)
        if isinstance(manifest, Manifest) and manifest.run_id == folder.run_id
    )


def damaged_runs(root: Path) -> tuple[tuple[RunFolder, RecordingError], ...]:
    """Return the runs under `root` whose manifest cannot be read, and why, oldest first."""
    return tuple(
        (folder, manifest)
        for folder, manifest in _runs(root)
        if isinstance(manifest, RecordingError)
    )


def _runs(root: Path) -> Iterator[tuple[RunFolder, Manifest | RecordingError]]:
    """Yield every folder that is named as runs are."""
    if not root.is_dir():
        return
    for path in sorted(root.resolve().iterdir()):
        if not RUN_ID.fullmatch(path.name) or path.is_symlink():
            continue
        folder = RunFolder(path, path.name)
        try:
            yield folder, folder.manifest()
        except RecordingError as error:
            yield folder, error


def find_runs(root: Path, references: Iterable[str]) -> tuple[RunFolder, ...]:
    """Return the runs that `references` mean, each of them another one.

    Raises:
        ConfigError: One of them means no run, or more than one; or a run, or its copy, is named
            twice.
        RecordingError: As `find_run` does.
    """
    found = tuple(find_run(root, reference) for reference in references)
    seen: set[str] = set()
    for folder in found:
        if folder.run_id in seen:
            raise ConfigError(
                f"run {folder.run_id} is named twice, or with its copy", code="RID-OPTION-EXCLUSIVE"
            )
        seen.add(folder.run_id)
    return found


def find_run(root: Path, reference: str, having: str | None = None) -> RunFolder:
    """Return the run that `reference` means; of runs of one label the newest, which is said.

    Args:
        root: Folder of all runs.
        reference: A path of a run folder, `latest`, an id or the unique beginning of one, or a
            label.
        having: Only runs that hold this file are meant, where a label or `latest` is given.

    Raises:
        ConfigError: No run is meant, or an id's beginning means more than one.
        RecordingError: The folder at that path is not a run, or the latest one is damaged.
    """
    if (Path(reference) / MANIFEST).exists():
        return RunFolder.open(Path(reference))
    try:
        return find_run_inside(root, reference, having)
    except ConfigError:
        if Path(reference).is_file():
            raise ConfigError(
                f"{reference} is a file, no run: name a run by its label or id, or make one of a"
                " recording by `rid-daq import`",
                code="RID-RUN-IS-FILE",
            ) from None
        raise


def find_run_inside(root: Path, reference: str, having: str | None = None) -> RunFolder:
    """Return the run under `root` that `reference` means; it is never taken for a path.

    Arguments and errors are those of `find_run`.
    """
    runs = list_runs(root)
    fit = [each for each in runs if having is None or each[0].file(having).exists()]
    if reference == LATEST and fit:
        for folder, problem in damaged_runs(root):
            if folder.run_id > fit[-1][0].run_id:
                raise RecordingError(
                    f"the latest run is damaged: {problem}; name the one you mean",
                    code="RID-RUN-DAMAGED",
                )
        return fit[-1][0]
    labelled = [each for each in fit if each[1].label == reference]
    if len(labelled) > 1:
        _LOG.warning("%s", _newest_words(reference, labelled))
    if labelled:
        return labelled[-1][0]
    meant = [each for each in runs if reference and each[0].run_id.startswith(reference.upper())]
    if len(meant) == 1:
        return meant[0][0]
    if meant:
        which = ", ".join(map(_words, meant[-SHOWN:]))
        raise ConfigError(
            f"run {reference!r} may be any of {which}: give more of the id",
            code="RID-RUN-AMBIGUOUS",
        )
    what = "run" if having is None else f"run with {having}"
    raise ConfigError(
        f"no {what} {reference!r} under {root}: `rid-daq runs` lists them", code="RID-RUN-UNKNOWN"
    )


def file_or_run(root: Path, reference: str, having: str | None = None) -> Path | RunFolder:
    """Return the file of that name where there is one, and otherwise the run that it means.

    Args:
        root, reference, having: As `find_run` has them; a label may look like the name of a file.

    Raises:
        ConfigError, RecordingError: There is no such file, and `find_run` raises this.
    """
    path = Path(reference)
    if path.is_file():
        return path
    try:
        return find_run(root, reference, having)
    except ConfigError as error:
        raise ConfigError(
            f"{reference}: there is no such file, and {error}", code=error.refusal
        ) from None


def _newest_words(label: str, labelled: Sequence[tuple[RunFolder, Manifest]]) -> str:
    *others, newest = labelled
    older = ", ".join(map(_words, reversed(others[-SHOWN:])))
    more = len(others) - SHOWN
    older += f" and {more} more" if more > 0 else ""
    return (
        f"{len(labelled)} runs are called {label!r}: the newest is taken, {_words(newest)}; older:"
        f" {older}"
    )


def _words(run: tuple[RunFolder, Manifest]) -> str:
    folder, manifest = run
    return f"{folder.run_id} ({manifest.created_utc[:16].replace('T', ' ')} UTC)"
