"""Changes of the payload during a run, as its folder stores them."""

from __future__ import annotations

from typing import Final

from acquisition.motion.load_changes import LoadChanges, load_changes_content
from acquisition.runs.folder import RunFolder
from config.errors import DataQualityError

LOAD_CHANGES: Final = "load_changes.json"


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


def load_change_notes(folder: RunFolder, name: str) -> list[str]:
    """Return sentences on the changes of the payload during a run; empty without changes.

    Args:
        folder: The run.
        name: Name of the run in the sentences.
    """
    changes = load_changes_of(folder)
    if changes is None:
        return []
    found, missed = [], []
    for change in changes.changes:
        if change.lateness_s is not None:
            late_ms = 1e3 * change.lateness_s
            side = "later" if late_ms > 0.0 else "earlier"
            found.append(f"{change.came_s:.3f} s (signal, {abs(late_ms):.0f} ms {side} than at_s)")
        elif change.signal is not None:
            missed.append(
                f"{name}: the signal of the load change at {change.at_s:g} s did not come"
            )
        else:
            found.append(f"{change.at_s:g} s")
    if found:
        missed.insert(0, f"{name}: the payload changed during the motion, at {', '.join(found)}")
    return missed


def refuse_changed_load(folder: RunFolder) -> None:
    """Refuse a run during which the payload changed.

    Raises:
        DataQualityError: The payload changed.
    """
    changes = load_changes_of(folder)
    if changes is not None:
        raise DataQualityError(
            f"{folder.path}: the payload changed during the motion, at {changes.times}, but one"
            " payload must apply to the whole run here: use a run without load changes",
            code="RID-LOAD-CHANGES",
        )
