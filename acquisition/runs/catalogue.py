"""Finding runs: the folders under a root are the truth, an index is not needed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import LATEST, MANIFEST, Manifest
from acquisition.runs.run_id import RUN_ID
from config.errors import ConfigError, RecordingError


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

    Raises
    ------
    ConfigError
        One of them means no run, or more than one; or a run, or its copy, is named twice.
    RecordingError
        As `find_run` does.
    """
    found = tuple(find_run(root, reference) for reference in references)
    seen: set[str] = set()
    for folder in found:
        if folder.run_id in seen:
            raise ConfigError(f"run {folder.run_id} is named twice, or with its copy")
        seen.add(folder.run_id)
    return found


def find_run(root: Path, reference: str) -> RunFolder:
    """Return the run that `reference` means.

    Parameters
    ----------
    root : Path
        Folder of all runs.
    reference : str
        A path of a run folder, `latest`, an id or the unique beginning of one, or a unique label.

    Raises
    ------
    ConfigError
        No run is meant, or more than one.
    RecordingError
        The folder at that path is not a run, or the latest one is damaged.
    """
    if (Path(reference) / MANIFEST).exists():
        return RunFolder.open(Path(reference))
    runs = list_runs(root)
    if reference == LATEST and runs:
        for folder, problem in damaged_runs(root):
            if folder.run_id > runs[-1][0].run_id:
                raise RecordingError(f"the latest run is damaged: {problem}; name the one you mean")
        return runs[-1][0]
    meant = [
        folder
        for folder, manifest in runs
        if (reference and folder.run_id.startswith(reference.upper()))
        or manifest.label == reference
    ]
    if len(meant) == 1:
        return meant[0]
    if meant:
        ids = ", ".join(folder.run_id for folder in meant[:10])
        raise ConfigError(f"run {reference!r} may be any of {ids}: give more of the id")
    raise ConfigError(f"no run {reference!r} under {root}: `rid-daq runs` lists them")
