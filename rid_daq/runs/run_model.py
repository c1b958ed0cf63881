"""`read_model`: a model file, compared with the run whose folder contains it."""

from __future__ import annotations

from pathlib import Path

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import MANIFEST
from config.errors import RecordingError
from config.formats.json_file import read_content
from identification.estimation.estimate import Estimate
from identification.estimation.file import LARGEST_FILE_BYTES, estimate_content
from rid_daq.runs.run_data import require_own
from rid_daq.terminal.choices import MODEL


def read_model(path: Path) -> Estimate:
    """Return the model of a file; see `read_model_and_bytes`."""
    return read_model_and_bytes(path)[0]


def read_model_and_bytes(path: Path) -> tuple[Estimate, bytes]:
    """Return the model of a file, and the file's bytes.

    The file `model.json` of a run folder must be that run's model, and the run's recording and
    robot must be those from which it was identified.

    Raises:
        ConfigError: The file cannot be read or is not a model.
        RecordingError: The file is in the folder of a run from which it was not identified, or a
            file of this run has changed.
    """
    content = read_content(path, LARGEST_FILE_BYTES)
    estimate = estimate_content(content, path)
    if path.name == MODEL and (path.parent / MANIFEST).is_file():
        _require_own_model(RunFolder.open(path.parent), path, estimate)
    return estimate, content


def _require_own_model(folder: RunFolder, path: Path, estimate: Estimate) -> None:
    if estimate.run_ids and folder.run_id not in estimate.run_ids:
        runs = ", ".join(estimate.run_ids)
        raise RecordingError(
            f"{path}: the model was identified from {runs}, not from {folder.run_id}, whose folder"
            f" contains it. Remove it from the folder, or identify this run:"
            f" `rid-daq identify {folder.path}`",
            code="RID-RUN-MIXED",
        )
    folder.read(MODEL)  # raises an error if the file has changed since it was written
    require_own(folder)
