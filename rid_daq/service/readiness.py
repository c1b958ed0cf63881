"""`Readiness`: decides if a cell may move, from its newest preflight, its files and open faults."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Final

from acquisition.motion.known_pose import MOVED
from config.process.safety_clock import safety_now_s
from rid_daq.preflight.axis_test import UNTESTED
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.records import Preflight
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.store.cells import CellStore

PREFLIGHT_LIMIT_S: Final = 1800.0
NOT_SINCE_START: Final = "the service was restarted after the preflight: repeat the preflight."
SINCE_FAULT: Final = "a fault has stopped a motion after the preflight: repeat the preflight."

_NO_FAULT = frozenset(
    {
        "INTERRUPTED",
        "STOP_COMMAND",
        "STOP_BUTTON",
        "CLIENT_LOST",
        "SERVICE_LOST",
        "PROGRAM_GONE",
        "RECORDER",
        "LATE_CYCLE",
        "POINTS_LOST",
        "POINTS_REFUSED",
    }
)
"""Codes of stops after which no one has to inspect the robot before the next preflight."""


class Readiness:
    """Readiness of cells for motions.

    A preflight is valid for `PREFLIGHT_LIMIT_S`, and only until the service is restarted or paused,
    a fault occurs, or the files of the cell change. Then it is stored for display only.

    Args:
        store: Table of preflights and faults.
        now_s: The safety clock [s].
    """

    def __init__(self, store: CellStore, now_s: Callable[[], float] = safety_now_s) -> None:
        self._store = store
        self._now_s = now_s
        self._checked_s: dict[str, float] = {}
        self._void_since = NOT_SINCE_START

    def age_s(self, cell: ServedCell) -> float | None:
        """Return the age of the newest preflight [s]; None if a start or pause came after it."""
        checked_s = self._checked_s.get(cell.name)
        return None if checked_s is None else self._now_s() - checked_s

    def preflight(self, cell: ServedCell) -> Preflight | None:
        """Return the newest preflight; if it is void, also the reason."""
        found = self._store.preflight(cell.name)
        if found is None:
            return None
        present = {"void_because": self._void_reason(cell, *found), "age_s": self.age_s(cell)}
        return found[0].model_copy(update=present)

    def obstacle(self, cell: ServedCell, kind: JobKind | None = None) -> str:
        """Return the reason why a cell is not ready to move, in a sentence; empty if it is ready.

        Args:
            kind: Kind of the requested motion, because some kinds need no axis test (default: any
                motion).
        """
        fault = self._store.fault(cell.name)
        if fault:
            return f"stopped by a fault: {fault} Find its cause, then reset the cell."
        if cell.problem:
            return f"the cell's files have errors: {cell.problem}"
        found = self._store.preflight(cell.name)
        if found is None:
            return "the cell has had no preflight yet: check the cell."
        return self._void_reason(cell, *found, kind=kind)

    def void_all(self, why: str) -> None:
        """Void all preflights so far, for a reason in a sentence."""
        self._checked_s.clear()
        self._void_since = why

    def fault(self, cell: ServedCell) -> str:
        """Return the open fault of a cell, empty without a fault."""
        return self._store.fault(cell.name)

    def note_check(self, cell: ServedCell, document: Mapping[str, object] | None) -> None:
        """Save the result of a preflight, with the hash of the files that it has read."""
        lines = None if document is None else document.get("lines")
        if document is None or not isinstance(lines, list):
            return
        problem = document.get("problem")
        preflight = Preflight(
            at_s=time.time(),
            passed=bool(document.get("passed")),
            problem=None if problem is None else str(problem),
            lines=tuple(lines),
        )
        self._store.note_preflight(cell.name, preflight, str(document.get("files_hash")))
        self._checked_s[cell.name] = self._now_s()

    def note_end(self, cell: ServedCell, document: Mapping[str, object] | None) -> None:
        """Save the fault that has stopped a motion, if there is one; it voids the preflight."""
        stop = None if document is None else document.get("stop")
        if isinstance(stop, dict) and stop.get("code") not in _NO_FAULT:
            self._note_fault(cell.name, str(stop.get("text", "the motion was stopped.")))

    def note_death(self, cell: str, why: str) -> None:
        """Save the fault that a motion's process died, which leaves the motion's end unknown."""
        self._note_fault(cell, f"{why}.")

    def note_reset(self, cell: ServedCell) -> None:
        """Delete the fault that a person has reset; the cell needs a new preflight."""
        self._store.note_fault(cell.name, "")

    def _note_fault(self, cell: str, fault: str) -> None:
        self._store.note_fault(cell, fault)
        found = self._store.preflight(cell)
        if found is not None:
            preflight, files_hash = found
            void = preflight.model_copy(update={"void_because": SINCE_FAULT})
            self._store.note_preflight(cell, void, files_hash)

    def _void_reason(
        self,
        cell: ServedCell,
        preflight: Preflight,
        files_hash: str,
        kind: JobKind | None = None,
    ) -> str:
        if preflight.void_because:
            return preflight.void_because
        if not (preflight.passed or _is_sufficient_for(preflight, kind)):
            return (
                "the preflight has failed: follow the advice in the failed lines, then repeat the"
                " preflight."
            )
        age_s = self.age_s(cell)
        if age_s is None:
            return self._void_since
        if age_s > PREFLIGHT_LIMIT_S:
            return f"the preflight is {age_s / 60.0:.0f} min old: repeat the preflight."
        if files_hash != cell.loaded.files_hash:
            return "the cell's files have changed after the preflight: repeat the preflight."
        return ""


def _is_sufficient_for(preflight: Preflight, kind: JobKind | None) -> bool:
    """Return True if a failed preflight lacks only items that a kind of motion does not need."""
    red = [line.code for line in preflight.lines if line.verdict == "red"]
    waits_for_axes_only = preflight.problem is None and {*red} <= {UNTESTED, MOVED}
    is_held = kind is not None and not kind.operation.needs_axis_test
    return is_held and bool(red) and waits_for_axes_only
