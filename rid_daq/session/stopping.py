"""Stopping the sessions that run on this machine: all are asked first, then watched to rest."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from acquisition.supervision.stop_reason import StopCode
from acquisition.task.control_block import ControlBlock
from acquisition.task.states import TaskState
from rid_daq.session.running_sessions import RunningSession

LOOK_S: Final = 0.002
STOP_PATIENCE_S: Final = 2.0
REST_PATIENCE_S: Final = 15.0
END_PATIENCE_S: Final = 30.0


@dataclass(frozen=True)
class Stopped:
    """What became of a session that was told to stop.

    Attributes:
        seen: Whether it was seen to have stopped.
        sentence: What happened, with times.
        rest_at: When the axes were at rest, where they moved and that was seen.
    """

    seen: bool
    sentence: str
    rest_at: str | None = None


def stop_sessions(sessions: Sequence[RunningSession]) -> list[tuple[RunningSession, Stopped]]:
    """Stop sessions; return what became of each."""
    # First the request to everyone, then the looking.
    waits = [(session, _ask(session)) for session in sessions]
    return [(session, wait()) for session, wait in waits]


def _ask(session: RunningSession) -> Callable[[], Stopped]:
    """Tell a session to stop; return what waits until it has.

    Whatever goes wrong with it is told as its result: the others are stopped all the same.
    """
    try:
        wait = _told(session)
    except Exception as error:
        failed = _failed(error)
        return lambda: failed

    def waited() -> Stopped:
        try:
            return wait()
        except Exception as error:
            return _failed(error)

    return waited


def _failed(error: Exception) -> Stopped:
    return Stopped(False, f"could not be stopped from here: {error or type(error).__name__}")


def _told(session: RunningSession) -> Callable[[], Stopped]:
    if session.refusal is not None:
        refused = Stopped(False, session.refusal)
        return lambda: refused
    try:
        control = session.control()
    except (OSError, ValueError):
        # as for a program with capabilities of its own: it can be told, but not watched
        session.terminate()
        return lambda: _wait_for_end(session, "told to end; whether its axes rest was not seen")
    if control is None:
        session.terminate()
        return lambda: _wait_for_end(session, None)
    began_s = time.monotonic()
    control.program.request_stop(StopCode.STOP_COMMAND)
    return lambda: _wait_for_rest(session, control, began_s)


def _wait_for_end(session: RunningSession, doubt: str | None) -> Stopped:
    ended = _wait(lambda: not session.is_running, END_PATIENCE_S)
    if not ended:
        return Stopped(False, f"did not end within {END_PATIENCE_S:g} s")
    if doubt is not None:
        return Stopped(False, doubt)
    return Stopped(True, "ended; no motion was under way")


def _wait_for_rest(session: RunningSession, control: ControlBlock, began_s: float) -> Stopped:
    """Watch a motion until its axes rest.

    The task may be configuring drives when it is told: the request is then seen before they move.
    """

    def is_over() -> bool:
        return control.task_gone or not session.is_running

    def has_answered() -> bool:
        return control.task.stop_reason is not None or is_over()

    patience_s = STOP_PATIENCE_S if control.task.state is TaskState.MOVING else END_PATIENCE_S
    if not _wait(has_answered, patience_s):
        return Stopped(False, f"did not answer within {patience_s:g} s")
    answered_ms = 1e3 * (time.monotonic() - began_s)
    _wait(lambda: control.task.ramp_s is not None or is_over(), REST_PATIENCE_S)
    reason, ramp_s = control.task.stop_reason, control.task.ramp_s
    now = datetime.now().astimezone()
    if reason is not None and ramp_s is not None:
        why = "quick stop"
        if reason.code is not StopCode.STOP_COMMAND:
            why = f"was stopping already ({reason.text})"
        return Stopped(
            True,
            f"{why} seen {answered_ms:.0f} ms after the request; all axes at rest {ramp_s:.3f} s"
            f" later, at {now:%H:%M:%S}.{now.microsecond // 1000:03d}.",
            now.isoformat(timespec="milliseconds"),
        )
    if is_over() and control.task.state is TaskState.FINISHED:
        if not control.task.power_off:
            return Stopped(False, _power_words(control))
        if reason is None:
            return Stopped(True, "ended by itself meanwhile; the drives are off")
        if not control.progress.cycles:
            return Stopped(True, "stopped before the motion; the axes did not move")
        return Stopped(False, "stopped, but the axes were not seen to come to rest")
    return Stopped(False, "did not come to its end: nobody knows what its axes do")


def _power_words(control: ControlBlock) -> str:
    """Say that nobody saw the drives without power, and what the task has said of its end."""
    said = [*([control.task.error] if control.task.error else []), *control.task.notes]
    return (
        "ended without confirmation that power is off: make sure of it before entering the cell"
        + (f" ({'; '.join(map(str, said))})" if said else "")
    )


def _wait(condition: Callable[[], bool], patience_s: float) -> bool:
    """Wait until a condition holds; return whether it did in time."""
    until_s = time.monotonic() + patience_s
    while not condition():
        if time.monotonic() > until_s:
            return condition()
        time.sleep(LOOK_S)
    return True
