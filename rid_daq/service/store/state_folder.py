"""`open_state_folder`: the folder that a service believes, refused if others could have made it."""

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
    """Return the state folder of a service, made if there is none.

    Whoever can write there is administrator: so it and what lies in it must be this user's alone,
    and nobody else may be able to put another one in its place.

    Args:
        folder: The service's folder.

    Raises:
        RecordingError: Another user made it, or can change it (`RID-STATE-NOT-PRIVATE`); or it
            cannot be made.
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
            f"{path}: {problem}. Whoever writes there decides who is let in to the service",
            code=NOT_PRIVATE,
        )
