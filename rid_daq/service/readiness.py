"""`Readiness`: whether a cell may move: its newest preflight, its files, and open faults."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Final

from config.process.safety_clock import safety_now_s
from rid_daq.preflight.axis_test import AXIS_TEST
from rid_daq.preflight.last_pose import LAST_POSE
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.records import Preflight
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.store.cells import CellStore

PREFLIGHT_LIMIT_S: Final = 1800.0
NOT_SINCE_START: Final = "the service has been started since: check it again."
SINCE_FAULT: Final = "a fault has stopped a motion since: check it again."

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
"""Stops after which nobody needs to look at the robot before the next preflight."""


class Readiness:
    """Whether cells are ready.

    A preflight counts in the service that has seen its end, and as long as that one goes on: the
    store keeps its lines for people.

    Args:
        store: Where preflights and faults are kept.
        now_s: The safety clock [s].
    """

    def __init__(self, store: CellStore, now_s: Callable[[], float] = safety_now_s) -> None:
        self._store = store
        self._now_s = now_s
        self._checked_s: dict[str, float] = {}
        self._void_since = NOT_SINCE_START

    def age_s(self, cell: ServedCell) -> float | None:
        """Return how old the newest preflight is [s], None where there is none that counts."""
        checked_s = self._checked_s.get(cell.name)
        return None if checked_s is None else self._now_s() - checked_s

    def preflight(self, cell: ServedCell) -> Preflight | None:
        """Return the newest preflight, with why it does not count where it does not."""
        found = self._store.preflight(cell.name)
        if found is None:
            return None
        told = {"void_because": self._void(cell, *found), "age_s": self.age_s(cell)}
        return found[0].model_copy(update=told)

    def obstacle(self, cell: ServedCell, kind: JobKind | None = None) -> str:
        """Return why the cell is not ready to move, in a sentence; empty where it is.

        Args:
            kind: The motion that is wanted: some need no axis test. Any motion if not given.
        """
        fault = self._store.fault(cell.name)
        if fault:
            return f"stopped by a fault: {fault} Find its cause, then reset the cell."
        if cell.problem:
            return f"its files are wrong: {cell.problem}"
        found = self._store.preflight(cell.name)
        if found is None:
            return "it was not checked yet: check it."
        return self._void(cell, *found, kind=kind)

    def void_all(self, why: str) -> None:
        """Let no preflight of before count, for a reason in a sentence."""
        self._checked_s.clear()
        self._void_since = why

    def fault(self, cell: ServedCell) -> str:
        """Return the open fault, empty where there is none."""
        return self._store.fault(cell.name)

    def note_check(self, cell: ServedCell, document: Mapping[str, object] | None) -> None:
        """Keep what a check has found, of the files that it says it has read."""
        told = None if document is None else document.get("lines")
        if document is None or not isinstance(told, list):
            return
        problem = document.get("problem")
        preflight = Preflight(
            at_s=time.time(),
            passed=bool(document.get("passed")),
            problem=None if problem is None else str(problem),
            lines=tuple(told),
        )
        self._store.note_preflight(cell.name, preflight, str(document.get("files_hash")))
        self._checked_s[cell.name] = self._now_s()

    def note_end(self, cell: ServedCell, document: Mapping[str, object] | None) -> None:
        """Keep the fault that has stopped a motion, where one has; its preflight is void."""
        stop = None if document is None else document.get("stop")
        if isinstance(stop, dict) and stop.get("code") not in _NO_FAULT:
            self._note_fault(cell.name, str(stop.get("text", "the motion was stopped.")))

    def note_death(self, cell: str, why: str) -> None:
        """Keep that a motion's process died: nobody saw how it came to rest; as `note_end`."""
        self._note_fault(cell, f"{why}.")

    def note_reset(self, cell: ServedCell) -> None:
        """Forget the fault that a person has reset; the cell must be checked again."""
        self._store.note_fault(cell.name, "")

    def _note_fault(self, cell: str, fault: str) -> None:
        self._store.note_fault(cell, fault)
        found = self._store.preflight(cell)
        if found is not None:
            preflight, files_hash = found
            void = preflight.model_copy(update={"void_because": SINCE_FAULT})
            self._store.note_preflight(cell, void, files_hash)

    def _void(
        self,
        cell: ServedCell,
        preflight: Preflight,
        files_hash: str,
        kind: JobKind | None = None,
    ) -> str:
        if preflight.void_because:
            return preflight.void_because
        if not (preflight.passed or _suffices(preflight, kind)):
            return "its preflight is red: see there what to do, then check again."
        age_s = self.age_s(cell)
        if age_s is None:
            return self._void_since
        if age_s > PREFLIGHT_LIMIT_S:
            return f"its preflight is {age_s / 60.0:.0f} min old: check it again."
        if files_hash != cell.loaded.files_hash:
            return "its files have changed since the preflight: check it again."
        return ""


def _suffices(preflight: Preflight, kind: JobKind | None) -> bool:
    """Return whether a red preflight lacks nothing that a kind of motion needs."""
    red = [line.get("what") for line in preflight.lines if line.get("verdict") == "red"]
    waits_for_axes_only = preflight.problem is None and {*red} <= {AXIS_TEST, LAST_POSE}
    is_held = kind is not None and not kind.operation.needs_axis_test
    return is_held and bool(red) and waits_for_axes_only
