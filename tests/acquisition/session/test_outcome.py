"""Outcome of a motion: a stop request that comes too late stops the next motions.

Only confirmed states are reported.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from acquisition.journal.cycles import JournalWriter
from acquisition.journal.header import JournalHeader
from acquisition.session.helper_process import HelperProcess
from acquisition.session.outcome import RecordOutcome, collect_outcome
from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.task.control_block import ControlBlock
from acquisition.task.ring import Ring
from acquisition.task.states import TaskState
from config.process.termination import Interruption, signals_handled

HEADER = JournalHeader(joint_names=("a", "b"), sample_period_s=0.008)

Outcome = Callable[..., RecordOutcome]


@pytest.fixture
def control() -> ControlBlock:
    """The control block of a motion that has finished."""
    control = ControlBlock.create()
    control.task.state = TaskState.FINISHED
    return control


@pytest.fixture
def outcome(control: ControlBlock, tmp_path: Path) -> Outcome:
    def of(interruption: Interruption | None = None, exit_code: int = 0) -> RecordOutcome:
        path = tmp_path / "recording.mcap"
        ring = Ring.create(2, 8)
        assert ring.write((0.0, 0.0, 0.0, *range(10), 1, 2, 0, -1, *(0,) * 4, 1, 1, 3))
        with JournalWriter(path, HEADER) as journal:
            journal.append(ring.read())
        task = HelperProcess("cyclic task", os.abort, (), patience_s=0.0)
        task.exit_code = exit_code
        return collect_outcome(
            path, HEADER, task, control, interruption or Interruption(), [], None
        )

    return of


def test_after_an_undisturbed_motion_the_next_one_can_start(outcome: Outcome) -> None:
    ended = outcome()
    assert ended.complete
    assert ended.late_stop is None


@pytest.mark.parametrize(
    ("code", "who"),
    [
        (StopCode.INTERRUPTED, "by the user"),
        (StopCode.STOP_COMMAND, "`rid-daq stop`"),
        (StopCode.STOP_BUTTON, "the page's stop button"),
        (StopCode.CLIENT_LOST, "the motion's client has lost the lease of the cell"),
    ],
)
def test_a_stop_request_after_the_end_of_the_motion_stops_the_sequence(
    outcome: Outcome, control: ControlBlock, code: StopCode, who: str
) -> None:
    control.program.request_stop(code)
    ended = outcome()
    assert ended.complete
    assert ended.late_stop is not None
    assert ended.late_stop.code is code
    assert who in ended.late_stop.text
    assert "after the end of the motion" in ended.late_stop.text


def test_a_signal_after_the_end_stops_the_sequence_despite_an_earlier_request(
    outcome: Outcome, control: ControlBlock
) -> None:
    # an earlier stop request, from the recorder that ends after the task
    control.program.request_stop(StopCode.RECORDER)
    with signals_handled(lambda: control.program.request_stop(StopCode.INTERRUPTED)) as came:
        signal.raise_signal(signal.SIGTERM)
    ended = outcome(came)
    assert ended.late_stop is not None
    assert ended.late_stop.code is StopCode.INTERRUPTED
    assert ended.interrupted_by is signal.SIGTERM


def test_a_recorder_that_ends_before_the_task_is_not_a_late_stop(
    outcome: Outcome, control: ControlBlock
) -> None:
    control.program.request_stop(StopCode.RECORDER)
    assert outcome().late_stop is None


def test_a_stop_during_the_motion_is_not_a_late_stop(
    outcome: Outcome, control: ControlBlock
) -> None:
    control.program.request_stop(StopCode.STOP_BUTTON)
    control.task.report_stop(StopReason(StopCode.STOP_BUTTON, "stopped"))
    ended = outcome()
    assert not ended.complete
    assert ended.late_stop is None


@pytest.mark.parametrize(
    ("power_off", "expected"),
    [(True, "disabled the drives"), (False, "without confirmation")],
)
def test_the_text_of_a_failed_task_states_if_power_off_was_confirmed(
    outcome: Outcome, control: ControlBlock, power_off: bool, expected: str
) -> None:
    control.task.power_off = power_off
    ended = outcome(exit_code=1)
    assert ended.stop is not None
    assert ended.stop.code is StopCode.TASK_DIED
    assert expected in ended.stop.text


def test_a_task_that_did_not_finish_has_died_with_any_exit_code(
    outcome: Outcome, control: ControlBlock
) -> None:
    control.task.state = TaskState.MOVING
    ended = outcome(exit_code=0)
    assert ended.stop is not None
    assert ended.stop.code is StopCode.TASK_DIED
