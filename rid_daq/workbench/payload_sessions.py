"""`interrupted_sessions`: payload sessions that can be resumed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from pydantic import JsonValue

from acquisition.runs.catalogue import list_runs
from acquisition.runs.manifest import RunStatus
from config.errors import RidDaqError
from rid_daq.operations.payload.payload_session import PayloadSessionRequest
from rid_daq.operations.payload.session_states import SessionFile
from rid_daq.terminal.job_events import SessionState

KIND: Final = "payload session"


@dataclass(frozen=True)
class InterruptedSession:
    """A payload session that has not been completed.

    Attributes:
        run, label, created_utc: Its id, its label, and its start time.
        state, done: Its present state, and its completed steps.
        choices: Options of its request; the path of the model is relative to the service's folder.
    """

    run: str
    label: str
    created_utc: str
    state: SessionState
    done: tuple[str, ...]
    choices: dict[str, JsonValue]


def interrupted_sessions(runs: Path, cell: str, folder: Path) -> tuple[InterruptedSession, ...]:
    """Return the incomplete sessions of a cell, the newest first.

    Args:
        runs: Folder of the run folders.
        cell: Name of the cell.
        folder: The service's folder.
    """
    found = []
    for run, manifest in list_runs(runs):
        if manifest.kind != KIND or manifest.status == RunStatus.COMPLETE:
            continue
        try:
            state = SessionFile.read(run)
            now = PayloadSessionRequest(cell=state.cell, runs=runs, resume=run.run_id)
            choices = now.with_original_options(state.request).choices
        except RidDaqError:  # this session cannot be resumed; the page Runs shows the reason
            continue
        if state.cell == cell:
            choices["model"] = _relative_path(folder.resolve(), choices["model"])
            found.append(
                InterruptedSession(
                    run=run.run_id,
                    label=manifest.label,
                    created_utc=manifest.created_utc,
                    state=state.state,
                    done=tuple(state.done),
                    choices=choices,
                )
            )
    return tuple(sorted(found, key=lambda each: each.run, reverse=True))


def _relative_path(folder: Path, file: JsonValue) -> JsonValue:
    """Return a file's path relative to the folder; unchanged if it is outside, or not a path."""
    if not isinstance(file, str) or not Path(file).is_relative_to(folder):
        return file
    return str(Path(file).relative_to(folder))
