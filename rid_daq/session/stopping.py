"""Stops running sessions: requests all stops first, then waits until all axes are at rest."""

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
class SessionStop:
    """Result of a stop request to a session.

    Attributes:
        is_confirmed: True if the stop was confirmed.
        sentence: What happened, with times.
        rest_at: Time at which the axes were at rest; None if they did not move or this was not
            observed.
    """

    is_confirmed: bool
    sentence: str
    rest_at: str | None = None


def stop_sessions(sessions: Sequence[RunningSession]) -> list[tuple[RunningSession, SessionStop]]:
    """Stop sessions; return the result for each session."""
    # send all requests before waiting for the first result
    waits = [(session, _start_stop(session)) for session in sessions]
    return [(session, wait()) for session, wait in waits]


def _start_stop(session: RunningSession) -> Callable[[], SessionStop]:
    """Send a stop request to a session; return a function that waits for the result.

    Any error is returned as the result of this session, so that the other sessions are stopped too.
    """
    try:
        wait = _send_stop(session)
    except Exception as error:
        failed = _failure(error)
        return lambda: failed

    def waited() -> SessionStop:
        try:
            return wait()
        except Exception as error:
            return _failure(error)

    return waited


def _failure(error: Exception) -> SessionStop:
    return SessionStop(False, f"could not be stopped from here: {error or type(error).__name__}")


def _send_stop(session: RunningSession) -> Callable[[], SessionStop]:
    if session.refusal is not None:
        refused = SessionStop(False, session.refusal)
        return lambda: refused
    try:
        control = session.control()
    except (OSError, ValueError):
        # for example, the session has other privileges: it gets signals but cannot be observed
        session.terminate()
        return lambda: _wait_for_end(
            session,
            "termination requested; the axes could not be observed: check that they are at rest",
        )
    if control is None:
        session.terminate()
        return lambda: _wait_for_end(session, None)
    began_s = time.monotonic()
    control.program.request_stop(StopCode.STOP_COMMAND)
    return lambda: _wait_for_rest(session, control, began_s)


def _wait_for_end(session: RunningSession, doubt: str | None) -> SessionStop:
    ended = _wait(lambda: not session.is_running, END_PATIENCE_S)
    if not ended:
        return SessionStop(False, f"did not end within {END_PATIENCE_S:g} s")
    if doubt is not None:
        return SessionStop(False, doubt)
    return SessionStop(True, "ended; there was no motion")


def _wait_for_rest(session: RunningSession, control: ControlBlock, began_s: float) -> SessionStop:
    """Watch a motion until its axes are at rest.

    A task that is still configuring drives has more time to answer, because it reads the stop
    request only afterwards, before the axes move.
    """

    def is_over() -> bool:
        return control.task_gone or not session.is_running

    def has_answered() -> bool:
        return control.task.stop_reason is not None or is_over()

    patience_s = STOP_PATIENCE_S if control.task.state is TaskState.MOVING else END_PATIENCE_S
    if not _wait(has_answered, patience_s):
        return SessionStop(False, f"did not answer within {patience_s:g} s")
    answered_ms = 1e3 * (time.monotonic() - began_s)
    _wait(lambda: control.task.ramp_s is not None or is_over(), REST_PATIENCE_S)
    reason, ramp_s = control.task.stop_reason, control.task.ramp_s
    now = datetime.now().astimezone()
    if reason is not None and ramp_s is not None:
        why = "quick stop"
        if reason.code is not StopCode.STOP_COMMAND:
            why = f"earlier stop ({reason.text})"
        return SessionStop(
            True,
            f"{why} seen {answered_ms:.0f} ms after the request; all axes at rest {ramp_s:.3f} s"
            f" later, at {now:%H:%M:%S}.{now.microsecond // 1000:03d}.",
            now.isoformat(timespec="milliseconds"),
        )
    if is_over() and control.task.state is TaskState.FINISHED:
        if not control.task.power_off:
            return SessionStop(False, _power_words(control))
        if reason is None:
            return SessionStop(True, "ended by itself in the meantime; the drives are off")
        if not control.progress.cycles:
            return SessionStop(True, "stopped before the motion; the axes did not move")
        return SessionStop(False, "stopped, but the axes were not seen to come to rest")
    return SessionStop(False, "did not end: the state of its axes is unknown")


def _power_words(control: ControlBlock) -> str:
    """Return the message that power off was not confirmed, with the task's error and notes."""
    causes = [*([control.task.error] if control.task.error else []), *control.task.notes]
    return (
        "ended without confirmation that power is off: make sure that power is off before you"
        " enter the cell" + (f" ({'; '.join(map(str, causes))})" if causes else "")
    )


def _wait(condition: Callable[[], bool], patience_s: float) -> bool:
    """Wait until a condition is true; return False if it is still false after `patience_s`."""
    until_s = time.monotonic() + patience_s
    while not condition():
        if time.monotonic() > until_s:
            return condition()
        time.sleep(LOOK_S)
    return True
