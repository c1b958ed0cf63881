"""`rid-daq stop`: it requests all stops before it waits, and reports only confirmed outcomes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import cast

import pytest

from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.task.control_block import ControlBlock
from acquisition.task.states import TaskState
from config.errors import DeviceTimeoutError
from rid_daq.session import stopping
from rid_daq.session.running_sessions import RunningSession
from rid_daq.session.stopping import SessionStop, stop_sessions

COMMAND = StopReason(StopCode.STOP_COMMAND, "rid-daq stop")
LIMIT = StopReason(StopCode.POSITION_LIMIT, "axis2 is beyond its limit")


class FakeSession:
    """A session with a behaviour that the test sets; it counts its terminations."""

    def __init__(
        self,
        control: ControlBlock | None = None,
        *,
        refusal: str | None = None,
        broken: Exception | None = None,
        lives: Callable[[], bool] = lambda: False,
    ) -> None:
        self.refusal = refusal
        self.terminated = 0
        self._control, self._broken, self._lives = control, broken, lives

    def control(self) -> ControlBlock | None:
        if self._broken is not None:
            raise self._broken
        return self._control

    def terminate(self) -> None:
        self.terminated += 1

    @property
    def is_running(self) -> bool:
        return self._lives()


@pytest.fixture(autouse=True)
def zero_timeouts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Set all timeouts to 0: a session has either reacted already, or never reacts."""
    for name in ("STOP_PATIENCE_S", "REST_PATIENCE_S", "END_PATIENCE_S"):
        monkeypatch.setattr(stopping, name, 0.0)


@pytest.fixture
def stop_all(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[SessionStop]]:
    """Return a function that stops fake sessions and returns each outcome."""

    def stop(*sessions: FakeSession) -> list[SessionStop]:
        found = cast("Sequence[RunningSession]", sessions)
        return [result for _, result in stop_sessions(found)]

    return stop


def moving_control(
    *,
    reason: StopReason | None = None,
    rest_s: float | None = None,
    state: TaskState = TaskState.MOVING,
    cycles: int = 100,
    power_off: bool = True,
) -> ControlBlock:
    """Return the control block of a motion after the stop request."""
    control = ControlBlock.create()
    control.task.state = state
    control.task.set_progress(10, 3, cycles)
    control.task.power_off = power_off
    if reason is not None:
        control.task.report_stop(reason)
    if rest_s is not None:
        control.task.report_rest(rest_s)
    return control


def test_a_motion_counts_as_stopped_if_its_axes_are_confirmed_at_rest(
    stop_all: Callable[..., list[SessionStop]],
) -> None:
    control = moving_control(reason=COMMAND, rest_s=0.25)
    (result,) = stop_all(FakeSession(control, lives=lambda: True))
    assert control.program.stop_code == StopCode.STOP_COMMAND
    assert result.is_confirmed
    assert "quick stop seen" in result.sentence
    assert "all axes at rest 0.250 s later" in result.sentence
    assert result.rest_at is not None


def test_a_motion_that_was_already_stopping_gives_its_reason(
    stop_all: Callable[..., list[SessionStop]],
) -> None:
    (result,) = stop_all(FakeSession(moving_control(reason=LIMIT, rest_s=0.1), lives=lambda: True))
    assert result.is_confirmed
    assert f"earlier stop ({LIMIT.text})" in result.sentence


def test_a_motion_that_does_not_answer_was_not_stopped(
    stop_all: Callable[..., list[SessionStop]],
) -> None:
    (result,) = stop_all(FakeSession(moving_control(), lives=lambda: True))
    assert result == SessionStop(False, "did not answer within 0 s")


def test_axes_without_confirmed_rest_do_not_count_as_stopped(
    stop_all: Callable[..., list[SessionStop]],
) -> None:
    ended = moving_control(reason=COMMAND, state=TaskState.FINISHED)
    (result,) = stop_all(FakeSession(ended))
    assert result == SessionStop(False, "stopped, but the axes were not seen to come to rest")


def test_after_a_crash_the_state_of_the_axes_is_reported_as_unknown(
    stop_all: Callable[..., list[SessionStop]],
) -> None:
    (result,) = stop_all(FakeSession(moving_control(reason=COMMAND), lives=lambda: False))
    assert result == SessionStop(False, "did not end: the state of its axes is unknown")


def test_a_motion_stopped_before_its_start_did_not_move(
    stop_all: Callable[..., list[SessionStop]],
) -> None:
    ended = moving_control(reason=COMMAND, state=TaskState.FINISHED, cycles=0)
    assert stop_all(FakeSession(ended)) == [
        SessionStop(True, "stopped before the motion; the axes did not move")
    ]


def test_a_motion_that_ended_by_itself_counts_as_stopped(
    stop_all: Callable[..., list[SessionStop]],
) -> None:
    (result,) = stop_all(FakeSession(moving_control(state=TaskState.FINISHED)))
    assert result == SessionStop(True, "ended by itself in the meantime; the drives are off")


@pytest.mark.parametrize("reason", [None, COMMAND])
def test_drives_without_confirmed_power_off_are_not_reported_as_off(
    stop_all: Callable[..., list[SessionStop]], reason: StopReason | None
) -> None:
    ended = moving_control(reason=reason, state=TaskState.FINISHED, cycles=0, power_off=False)
    ended.task.add_note("the drives of axis3 did not confirm being disabled")
    error = DeviceTimeoutError("the drives could not be enabled in time")
    error.add_note("while leaving the cell: axis3 is silent")
    ended.task.fail(error)
    (result,) = stop_all(FakeSession(ended))
    assert result == SessionStop(
        False,
        "ended without confirmation that power is off: make sure that power is off before you enter"
        " the cell (the drives could not be enabled in time; while leaving the cell: axis3 is"
        " silent; the drives of axis3 did not confirm being disabled)",
    )


def test_a_session_without_a_motion_is_ended(stop_all: Callable[..., list[SessionStop]]) -> None:
    quiet = FakeSession()
    assert stop_all(quiet) == [SessionStop(True, "ended; there was no motion")]
    assert quiet.terminated == 1


def test_a_session_that_does_not_end_is_not_stopped(
    stop_all: Callable[..., list[SessionStop]],
) -> None:
    assert stop_all(FakeSession(lives=lambda: True)) == [
        SessionStop(False, "did not end within 0 s")
    ]


@pytest.mark.parametrize("broken", [PermissionError("no"), ValueError("no block")])
def test_an_unobservable_session_is_terminated_and_not_reported_as_stopped(
    broken: Exception, stop_all: Callable[..., list[SessionStop]]
) -> None:
    guarded = FakeSession(broken=broken)
    (result,) = stop_all(guarded)
    assert guarded.terminated == 1
    assert result == SessionStop(
        False,
        "termination requested; the axes could not be observed: check that they are at rest",
    )


def test_a_session_of_another_user_is_not_terminated(
    stop_all: Callable[..., list[SessionStop]],
) -> None:
    other = FakeSession(refusal="belongs to another user")
    assert stop_all(other) == [SessionStop(False, "belongs to another user")]
    assert other.terminated == 0


def test_all_stops_are_requested_before_waiting_despite_a_failure(
    stop_all: Callable[..., list[SessionStop]],
) -> None:
    second = moving_control(reason=COMMAND, rest_s=0.1)
    asked_by_then: list[int] = []

    def lives() -> bool:
        asked_by_then.append(second.program.stop_code)
        return False

    first = FakeSession(lives=lives)
    broken = FakeSession(broken=RuntimeError("unforeseen"))
    results = stop_all(first, broken, FakeSession(second, lives=lambda: True))
    assert [each.is_confirmed for each in results] == [True, False, True]
    assert results[1].sentence == "could not be stopped from here: unforeseen"
    assert asked_by_then[0] == StopCode.STOP_COMMAND


@pytest.mark.parametrize(
    "text", ["name: cell-7\n", 'name: "cell-7"\naxes: [broken', "# x\nname:\tcell-7 # mine\n"]
)
def test_a_damaged_cell_file_still_gives_the_name_of_its_cell(text: str, tmp_path: Path) -> None:
    from rid_daq.operations.cell.stop import _cell_name

    file = tmp_path / "cell.yaml"
    file.write_text(text)
    assert _cell_name(str(file)) == "cell-7"
    assert _cell_name("ir361") == "ir361"
