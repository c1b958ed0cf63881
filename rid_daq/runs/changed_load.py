"""Changes of the payload during a run, as its folder stores them."""

from __future__ import annotations

import math
from typing import Final

from acquisition.motion.load_changes import LoadChanges, load_changes_content
from acquisition.runs.folder import RunFolder
from config.errors import DataQualityError

LOAD_CHANGES: Final = "load_changes.json"

_WITHOUT_TIME: Final = {
    "not_reached": "it did not begin: the motion ended before it",
    "awaited": "it did not begin: the motion ended before its signal came",
    "missed": "it did not begin: its signal did not come in time",
    "not_needed": "it did not begin: the robot carried this load already",
    "already_active": "it did not begin: its input was active already",
    None: "the program ended first, so that nothing is known about its signal",
}


def load_changes_bytes(changes: LoadChanges) -> bytes:
    """Return the content of a run's load-change file."""
    return changes.model_dump_json(indent=2).encode()


def load_changes_of(folder: RunFolder) -> LoadChanges | None:
    """Return the changes of the payload during a run; None if there were none.

    Raises:
        ConfigError: The file is damaged.
        RecordingError: The file cannot be read.
    """
    path = folder.file(LOAD_CHANGES)
    if not path.exists():
        return None
    return load_changes_content(folder.read(LOAD_CHANGES), str(path))


def load_change_notes(folder: RunFolder, name: str, reached_s: float = math.inf) -> list[str]:
    """Return sentences on the changes of the payload during a run; empty without changes.

    Args:
        folder: The run.
        name: Name of the run in the sentences.
        reached_s: Time of the last recorded row, from the first row of the motion [s].
    """
    changes = load_changes_of(folder)
    if changes is None:
        return []
    found, notes = [], []
    for change in changes.changes:
        if change.signal is None and change.outcome is None and change.at_s > reached_s:
            change = change.model_copy(update={"outcome": "not_reached"})
        if change.lateness_s is not None:
            late_ms = 1e3 * change.lateness_s
            side = "later" if late_ms > 0.0 else "earlier"
            found.append(f"{change.came_s:.3f} s (signal, {abs(late_ms):.0f} ms {side} than at_s)")
        elif change.begin_s is not None:
            found.append(f"{change.at_s:g} s")
        else:
            words = _WITHOUT_TIME[change.outcome]
            notes.append(f"{name}, load change at {change.at_s:g} s: {words}")
    if found:
        notes.insert(0, f"{name}: the payload changed during the motion, at {', '.join(found)}")
    return notes


def require_known_outcomes(changes: LoadChanges | None, name: str) -> None:
    """Refuse a run that does not contain the outcomes of its load changes at signals.

    Args:
        changes: The changes of the run; None if there were none.
        name: Name of the run, for messages.

    Raises:
        DataQualityError: The outcome of a load change is unknown.
    """
    for number, change in enumerate(() if changes is None else changes.changes, start=1):
        if change.signal is not None and change.came_s is None and change.outcome is None:
            raise DataQualityError(
                f"{name}: the outcome of load change {number} is unknown, because the program ended"
                " before it stored the signals: use another run, or leave the model out",
                code="RID-LOAD-SIGNAL-UNKNOWN",
            )


def refuse_changed_load(folder: RunFolder) -> None:
    """Refuse a run during which the payload changed.

    Raises:
        DataQualityError: The payload changed.
        ConfigError, RecordingError: The load-change file cannot be read.
    """
    changes = load_changes_of(folder)
    if changes is not None:
        raise DataQualityError(
            f"{folder.path}: the payload changed during the motion, at {changes.times}, but one"
            " payload must apply to the whole run here: use a run without load changes",
            code="RID-LOAD-CHANGES",
        )
