"""Finding runs: the folders under a root are the truth, an index is not needed."""

from __future__ import annotations

from pathlib import Path

from acquisition.run_folder import MANIFEST, Manifest, RunFolder
from acquisition.run_id import RUN_ID
from config.errors import ConfigError, RecordingError


def list_runs(root: Path) -> tuple[tuple[RunFolder, Manifest], ...]:
    """Return the runs under `root`, oldest first; what is not a readable run is left out."""
    if not root.is_dir():
        return ()
    runs = []
    for path in sorted(root.resolve().iterdir()):
        if not RUN_ID.fullmatch(path.name) or path.is_symlink():
            continue
        folder = RunFolder(path, path.name)
        try:
            manifest = folder.manifest()
        except RecordingError:
            continue
        if manifest.run_id == path.name:
            runs.append((folder, manifest))
    return tuple(runs)


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
        The folder at that path is not a run.
    """
    if (Path(reference) / MANIFEST).exists():
        return RunFolder.open(Path(reference))
    runs = list_runs(root)
    if reference == "latest" and runs:
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
