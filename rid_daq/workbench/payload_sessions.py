"""`sessions_of`: payload sessions of a cell, those that can be resumed and the finished ones."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from pydantic import JsonValue

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from config.errors import RidDaqError
from rid_daq.operations.payload.payload_session import PayloadSessionRequest
from rid_daq.operations.payload.session_states import SessionFile
from rid_daq.service.api.run_index import run_index
from rid_daq.terminal.job_events import SessionState

KIND: Final = "payload session"


@dataclass(frozen=True)
class FinishedSession:
    """A payload session with a result.

    Attributes:
        run, label, created_utc: Its id, its label, and its start time.
    """

    run: str
    label: str
    created_utc: str


@dataclass(frozen=True)
class InterruptedSession(FinishedSession):
    """A payload session that has not been completed.

    Attributes:
        state: Its present state.
        choices: Options of its request; the path of the model is relative to the service's folder.
    """

    state: SessionState
    choices: dict[str, JsonValue]


@dataclass(frozen=True)
class CellSessions:
    """Payload sessions of a cell, each list with the newest first."""

    interrupted: tuple[InterruptedSession, ...]
    finished: tuple[FinishedSession, ...]


def sessions_of(runs: Path, cell: str, folder: Path) -> CellSessions:
    """Return the payload sessions of a cell; those that cannot be read are left out.

    Args:
        runs: Folder of the run folders.
        cell: Name of the cell.
        folder: The service's folder.
    """
    interrupted, finished = [], []
    for run in run_index(runs).newest_first():
        if run.kind != KIND:
            continue
        try:
            state = SessionFile.read(RunFolder(runs.resolve() / run.id, run.id))
            if state.cell != cell:
                continue
            known = FinishedSession(run.id, run.label, run.created_utc)
            if run.status == RunStatus.COMPLETE:
                finished.append(known)
                continue
            now = PayloadSessionRequest(cell=state.cell, runs=runs, resume=run.id)
            choices = now.with_original_options(state.request).choices
        except RidDaqError:  # the page Runs shows the reason
            continue
        choices["model"] = _relative_path(folder.resolve(), choices["model"])
        interrupted.append(InterruptedSession(**vars(known), state=state.state, choices=choices))
    return CellSessions(tuple(interrupted), tuple(finished))


def _relative_path(folder: Path, file: JsonValue) -> JsonValue:
    """Return a file's path relative to the folder; unchanged if it is outside, or not a path."""
    if not isinstance(file, str) or not Path(file).is_relative_to(folder):
        return file
    return str(Path(file).relative_to(folder))
