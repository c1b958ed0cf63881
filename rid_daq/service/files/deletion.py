"""`delete_file`: delete a motion, model or other file that no cell and no run uses."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from config.errors import ConfigError, system_errors
from config.formats.approved_files import sha256_of
from config.formats.bounded_file import read_file
from rid_daq.service.refusals import FileChangedError, UnknownError

if TYPE_CHECKING:
    from rid_daq.service.service import CellService


def delete_file(service: CellService, path: Path, shown: str, version: str, most: int) -> None:
    """Delete a file of the service's folder if it still has the version that a client knows.

    A client that has uploaded a file for one job, such as the motion of `rid_daq.api.Cell.record`,
    deletes it in this way afterwards. The run of the job contains a copy.

    Args:
        service: The service.
        path: Resolved path of the file.
        shown: Path inside the folder, as the client wrote it.
        version: SHA-256 of the content that the client knows.
        most: Largest size of a file that clients upload [bytes].

    Raises:
        UnknownError: There is no such file (`RID-FILE-UNKNOWN`).
        ConfigError: The file belongs to a cell (`RID-OUTPUT-CELL`) or is in the runs folder
            (`RID-OUTPUT-RUN`), or it cannot be deleted.
        FileChangedError: The file has another version (`RID-FILE-CHANGED`).
    """
    if not path.is_file():
        raise UnknownError(f"no file {shown!r}", code="RID-FILE-UNKNOWN")
    of_cells = {
        each.resolve()
        for cell in service.cells.values()
        for each in cell.loaded.disk_names.values()
    }
    is_of_cell = path in of_cells
    if is_of_cell or path.is_relative_to(service.runs.resolve()):
        raise ConfigError(
            f"{shown}: cannot be deleted here: only files that belong to no cell and no run can",
            code="RID-OUTPUT-CELL" if is_of_cell else "RID-OUTPUT-RUN",
        )
    with system_errors(ConfigError, f"{shown}: cannot read", code="RID-FILE-READ"):
        found = sha256_of(read_file(path, most))
    if found != version:
        raise FileChangedError(
            f"{shown}: has changed since it was saved: nothing was deleted. Read the file again",
            code="RID-FILE-CHANGED",
        )
    with system_errors(ConfigError, f"{shown}: cannot be deleted", code="RID-FILE-WRITE"):
        path.unlink()
