"""`LoadSignals`: signals at which the load changes, watched in the cyclic task."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from multiprocessing import get_context
from typing import Any, Final, get_args

import numpy as np

from acquisition.motion.load_changes import ChangeOutcome, LoadChange, LoadChanges
from acquisition.supervision.stop_reason import StopCode, StopReason
from compensation.online.load_kernels import (
    BEGIN,
    EARLIEST,
    END,
    NOTICED,
    SETTLED,
    LoadArrays,
)
from config.arrays import FloatArray
from config.errors import PreflightError
from drivers.interfaces.servo_axes import Answers

ROUNDING_S: Final = 1e-9
"""Tolerance of comparisons between times that are multiples of the cycle time [s]."""

_OUTCOMES: Final[tuple[ChangeOutcome, ...]] = get_args(ChangeOutcome)


class LoadSignals:
    """Signals of a motion's load changes; the changes wait for one another, in their order.

    A signal is an input that becomes active while its change is awaited. An input that is already
    active by then cannot show the change, because the time at which it became active is not known.
    A change needs no signal if the robot already carries its load, because an earlier signal was
    missed.

    Observations are stored in shared memory, so that the program can read them after the motion.

    Args:
        changes: The changes, at least one with a signal.
        joints: Names of the joints, in the order of the drives.
        cycle_time_s: Cycle time [s].
        memory: Shared memory of two numbers per change; made if left out.
    """

    def __init__(
        self,
        changes: LoadChanges,
        joints: Sequence[str],
        cycle_time_s: float,
        memory: Any = None,
    ) -> None:
        count = len(changes.changes)
        self._changes = changes
        self._joints = tuple(joints)
        self._cycle_time_s = cycle_time_s
        self._memory = get_context("spawn").RawArray("d", 2 * count) if memory is None else memory
        shared: FloatArray = np.frombuffer(self._memory, dtype=np.float64)
        self._came_s, self._outcomes = shared[:count], shared[count:]  # time; index in _OUTCOMES
        if memory is None:
            self._came_s[:] = math.nan
            self._outcomes[:] = _OUTCOMES.index("not_reached")
        self._next = 0  # number of the change that is awaited
        self._carried = 0  # number of the present load
        self._inactive = False  # true if its input has been inactive since it is awaited
        self._since_s = math.nan  # time since which the input has been active
        self._stopped: list[int] = []

    def __reduce__(self) -> tuple[Callable[..., LoadSignals], tuple[Any, ...]]:
        return LoadSignals, (self._changes, self._joints, self._cycle_time_s, self._memory)

    @property
    def changes(self) -> LoadChanges:
        """The changes, with their outcomes and the times at which their signals came."""
        found = []
        for number, change in enumerate(self._changes.changes):
            came_s = float(self._came_s[number])
            observed = {
                "came_s": None if math.isnan(came_s) else came_s,
                "outcome": self._outcome(number),
            }
            found.append(change.model_copy(update=observed))
        return self._changes.model_copy(update={"changes": tuple(found)})

    @property
    def notes(self) -> list[str]:
        """One sentence per change that came, was missed or was not needed, and caused no stop."""
        notes = []
        for number, change in enumerate(self.changes.changes):
            if number in self._stopped:
                continue
            if change.outcome == "came":
                notes.append(f"{_change_name(number)}: {_lateness_words(change)}")
            elif change.outcome == "missed":
                notes.append(f"{_missed_words(number, change)}; the motion went on without it")
            elif change.outcome == "not_needed":
                notes.append(
                    f"{_change_name(number)}: the robot carried this load already, because an"
                    " earlier signal did not come"
                )
        return notes

    def refuse_active(self, answers: Answers) -> None:
        """Refuse to begin a motion whose first change waits for an input that is active already.

        Raises:
            PreflightError: The input is active.
        """
        reason = self.watch_approach(answers)
        if reason is not None:
            raise PreflightError(f"{reason.text}; nothing was moved", code="RID-LOAD-SIGNAL-ACTIVE")

    def watch_approach(self, answers: Answers) -> StopReason | None:
        """Return a reason not to begin the path, if the input of the first change is active."""
        change = self._changes.changes[0]
        active = None if change.signal is None else self._is_active(change, answers)
        if active is None:
            return None
        self._inactive = not active
        self._set(0, "already_active" if active else "not_reached")
        return _active_reason(0, change, "when the motion begins") if active else None

    def begin(self, loads: LoadArrays, ahead_s: float) -> LoadArrays:
        """Return the loads of a motion in which no signal has come yet; they change with `observe`.

        Args:
            loads: The loads, with the changes at their stated times.
            ahead_s: Time by which the path is computed ahead of the robot [s].
        """
        times = loads[0].copy()
        earliest_s = 0.0
        overlap_s = 0.0  # ramp of the previous change, if its signal may come just before this one
        for row, change in zip(times, self._changes.changes, strict=True):
            signal = change.signal
            row[SETTLED] = max(row[SETTLED], change.earliest_s + overlap_s)
            overlap_s = 0.0 if signal is None or signal.missed == "stop" else change.ramp_s
            if signal is None or signal.outside == "stop":
                earliest_s = change.earliest_s
            row[EARLIEST] = earliest_s
            if signal is not None:
                row[BEGIN] = row[END] = row[SETTLED] = math.inf
                if signal.missed == "stop":
                    noticed_s = change.latest_s + signal.debounce_s + self._cycle_time_s + ahead_s
                    row[SETTLED] = noticed_s + change.ramp_s
        self._loads = times, loads[1], loads[2]
        return self._loads

    def observe(self, time_s: float, head_s: float, answers: Answers) -> StopReason | None:
        """Evaluate the inputs of a cycle; return a reason to stop, if there is one.

        An input was actuated half a cycle time before it was first seen, on average.

        Args:
            time_s: Time of the cycle on the path, from its first point [s].
            head_s: Time up to which the path is computed [s].
            answers: The drives' answers.
        """
        changes = self._changes.changes
        while self._next < len(changes):
            number = self._next
            change = changes[number]
            if change.signal is None:
                if time_s < change.at_s:
                    return None
                self._finish(number, "begun")
            elif self._is_carried(number + 1):
                self._set(number, "not_needed")
                self._await(number + 1)
            elif self._outcome(number) == "missed" and head_s >= self._next_earliest_s:
                self._await(number + 1)
            else:
                return self._watch(number, time_s, head_s, answers)
        return None

    def note_stated(self, time_s: float) -> None:
        """Note the changes at stated times that begin while the robot stops on its path.

        Args:
            time_s: Time of the cycle on the path, from its first point [s].
        """
        for number, change in enumerate(self._changes.changes):
            if change.signal is None and time_s >= change.at_s:
                self._set(number, "begun")

    def _watch(
        self, number: int, time_s: float, head_s: float, answers: Answers
    ) -> StopReason | None:
        change = self._changes.changes[number]
        signal = change.signal
        assert signal is not None
        if self._outcome(number) == "not_reached":
            self._set(number, "awaited")
        active = self._is_active(change, answers)
        if active is None:
            return None
        seen_s = max(time_s - 0.5 * self._cycle_time_s, 0.0)
        if not active:
            self._inactive, self._since_s = True, math.nan
        elif not self._inactive:
            if time_s < change.earliest_s:
                return None
            self._stopped.append(number)
            self._set(number, "already_active")
            return _active_reason(number, change, f"at {change.earliest_s:g} s")
        elif math.isnan(self._since_s):
            self._since_s = seen_s
        if seen_s - self._since_s >= signal.debounce_s - ROUNDING_S:
            return self._accept(number, self._since_s, head_s)
        late = math.isnan(self._since_s) or self._since_s > change.latest_s
        if late and time_s > change.latest_s and self._outcome(number) != "missed":
            self._set(number, "missed")
            if signal.missed == "stop":
                self._stopped.append(number)
                return StopReason(
                    StopCode.LOAD_SIGNAL, _missed_words(number, change), joint=signal.joint
                )
        return None

    def _is_active(self, change: LoadChange, answers: Answers) -> bool | None:
        """Return True if the input of a change is active; None if the drive did not answer."""
        signal = change.signal
        assert signal is not None
        axis = self._joints.index(signal.joint)
        if not answers.received[axis]:
            return None
        return bool(int(answers.inputs[axis]) >> signal.bit & 1) == (signal.active == "high")

    def _accept(self, number: int, came_s: float, head_s: float) -> StopReason | None:
        """Begin a change at the time of its signal, or return the reason to stop."""
        self._came_s[number] = came_s
        self._set(number, "came")
        change = self._changes.changes[number].model_copy(update={"came_s": came_s})
        signal = change.signal
        assert signal is not None
        later = self._loads[0][number + 1 :, BEGIN]
        too_late = len(later) > 0 and later[0] <= head_s
        if too_late or (not change.in_window and signal.outside == "stop"):
            self._stopped.append(number)
            text = f"{_change_name(number)}: {_lateness_words(change)}"
            if too_late:
                text += ". The next change had already begun: give it a later at_s"
            return StopReason(
                StopCode.LOAD_SIGNAL,
                text,
                joint=signal.joint,
                value=came_s,
                limit=change.earliest_s if came_s < change.at_s else change.latest_s,
            )
        row = self._loads[0][number]
        row[BEGIN], row[END], row[NOTICED] = came_s, came_s + change.ramp_s, head_s
        self._finish(number, "came")
        return None

    def _finish(self, number: int, outcome: ChangeOutcome) -> None:
        self._set(number, outcome)
        self._carried = number + 1
        self._await(number + 1)

    def _await(self, number: int) -> None:
        self._next, self._inactive, self._since_s = number, False, math.nan

    def _set(self, number: int, outcome: ChangeOutcome) -> None:
        self._outcomes[number] = _OUTCOMES.index(outcome)

    def _outcome(self, number: int) -> ChangeOutcome:
        return _OUTCOMES[int(self._outcomes[number])]

    def _is_carried(self, load: int) -> bool:
        """Return True if a load equals the present one, because an earlier change did not begin."""
        if load == self._carried + 1:
            return False
        _, bodies, terms = self._loads
        same = np.array_equal(bodies[self._carried], bodies[load])
        return same and np.array_equal(terms[self._carried], terms[load])

    @property
    def _next_earliest_s(self) -> float:
        """Time from which the change after the awaited one is expected [s]."""
        later = self._changes.changes[self._next + 1 :]
        return later[0].earliest_s if later else math.inf


def _change_name(number: int) -> str:
    return f"load change {number + 1}"


def _missed_words(number: int, change: LoadChange) -> str:
    signal = change.signal
    assert signal is not None
    return (
        f"{_change_name(number)}: the signal (bit {signal.bit} of 60FDh, drive of {signal.joint})"
        f" did not come between {change.earliest_s:g} and {change.latest_s:g} s. Check the gripper,"
        " the part and the switch"
    )


def _active_reason(number: int, change: LoadChange, when: str) -> StopReason:
    signal = change.signal
    assert signal is not None
    return StopReason(
        StopCode.LOAD_SIGNAL,
        f"{_change_name(number)}: its input (bit {signal.bit} of 60FDh, drive of {signal.joint})"
        f" is active already {when}, so that it cannot show the change. Check if the switch is"
        " stuck and if the part is there already",
        joint=signal.joint,
    )


def _lateness_words(change: LoadChange) -> str:
    assert change.lateness_s is not None
    late_ms = 1e3 * change.lateness_s
    words = f"{abs(late_ms):.0f} ms {'later' if late_ms > 0.0 else 'earlier'} than at_s"
    window = ""
    if not change.in_window:
        window = f", outside its window from {change.earliest_s:g} to {change.latest_s:g} s"
    return f"the signal came at {change.came_s:.3f} s, {words}{window}"
