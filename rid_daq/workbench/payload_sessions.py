"""`interrupted_sessions`: payload sessions that can be gone on with."""

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
    """A payload session that has not come to its end.

    Attributes:
        run, label, created_utc: Its id, what people call it, and when it began.
        state, done: The state that it is in, and the steps that count already.
        choices: What it was begun with, as a request has it; the model as seen from the service's
            folder.
    """

    run: str
    label: str
    created_utc: str
    state: SessionState
    done: tuple[str, ...]
    choices: dict[str, JsonValue]


def interrupted_sessions(runs: Path, cell: str, folder: Path) -> tuple[InterruptedSession, ...]:
    """Return the sessions of a cell that have not come to their end, the newest first.

    Args:
        runs: The folder of the run folders.
        cell: The cell's name.
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
        except RidDaqError:  # it cannot be gone on with; the page of runs shows what is wrong
            continue
        if state.cell == cell:
            choices["model"] = _seen_from(folder.resolve(), choices["model"])
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


def _seen_from(folder: Path, file: JsonValue) -> JsonValue:
    """Return a file's path as requests name it; as it is where it lies elsewhere, or is none."""
    if not isinstance(file, str) or not Path(file).is_relative_to(folder):
        return file
    return str(Path(file).relative_to(folder))
