"""`interrupted_sessions`: payload sessions that can be gone on with."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from acquisition.runs.catalogue import list_runs
from acquisition.runs.manifest import RunStatus
from config.errors import RidDaqError
from rid_daq.recording.payload_state import SessionState

KIND: Final = "payload session"


@dataclass(frozen=True)
class InterruptedSession:
    """A payload session that has not come to its end.

    Attributes
    ----------
    run, label, created_utc : str
        Its id, what people call it, and when it began.
    done : tuple of str
        The steps that count already.
    """

    run: str
    label: str
    created_utc: str
    done: tuple[str, ...]


def interrupted_sessions(runs: Path, cell: str) -> tuple[InterruptedSession, ...]:
    """Return the sessions of a cell that have not come to their end, the newest first.

    Parameters
    ----------
    runs : Path
        The folder of the run folders.
    cell : str
        The cell's name.
    """
    found = []
    for folder, manifest in list_runs(runs):
        if manifest.kind != KIND or manifest.status == RunStatus.COMPLETE:
            continue
        try:
            state = SessionState.read(folder)
        except RidDaqError:  # it cannot be gone on with; the page of runs shows what is wrong
            continue
        if state.cell == cell:
            done = tuple(state.done)
            found.append(
                InterruptedSession(folder.run_id, manifest.label, manifest.created_utc, done)
            )
    return tuple(sorted(found, key=lambda each: each.run, reverse=True))
