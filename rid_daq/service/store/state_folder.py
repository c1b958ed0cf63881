"""`open_state_folder`: opens the folder with the service's state if only its user can change it."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from config.errors import RecordingError, system_errors
from config.process.private_folder import (
    changeable_by_others,
    file_problem,
    private_folder_problem,
)

STATE_FOLDER: Final = ".rid-daq-service"
NOT_PRIVATE: Final = "RID-STATE-NOT-PRIVATE"


def open_state_folder(folder: Path) -> Path:
    """Return the state folder of a service; create it if it is missing.

    A user who can write into this folder has administrator rights in the service. The folder and
    its content must therefore be private to this user, and no other user may be able to replace it.

    Args:
        folder: The service's folder.

    Raises:
        RecordingError: Another user owns the folder or can change it (`RID-STATE-NOT-PRIVATE`); or
            it cannot be created.
    """
    state = folder / STATE_FOLDER
    with system_errors(RecordingError, f"{state}: cannot be used", code="RID-FILE-ACCESS"):
        _refuse(folder, changeable_by_others(folder))
        state.mkdir(exist_ok=True, mode=0o700)
        _refuse(state, private_folder_problem(state))
        for path in sorted(state.iterdir()):
            _refuse(path, file_problem(path))
            if path.is_dir():
                for each in path.iterdir():
                    _refuse(each, file_problem(each))
    return state


def _refuse(path: Path, problem: str) -> None:
    if problem:
        raise RecordingError(
            f"{path}: {problem}. Any user who can write there controls the access to the service",
            code=NOT_PRIVATE,
        )
