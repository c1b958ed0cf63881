from __future__ import annotations

import pytest

from acquisition.motion.samples import Phase
from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.task.control_block import ControlBlock
from acquisition.task.states import TaskState
from config.errors import DriverError, PreflightError, RidDaqError, TransportError


@pytest.fixture
def control() -> ControlBlock:
    return ControlBlock.create()


def test_a_new_block_is_empty(control: ControlBlock) -> None:
    assert control.task.stop_reason is None
    assert control.task.error is None
    assert control.program.stop_code == 0
    assert control.task.notes == ()
    assert not control.task_gone
    assert control.progress.state is TaskState.STARTING
    assert control.progress.sample_index == -1


def test_the_first_reason_to_stop_is_kept(control: ControlBlock) -> None:
    reason = StopReason(StopCode.FOLLOWING_ERROR, "off by 0.1 rad · é", "joint2", 0.1, 0.05)
    control.task.report_stop(reason)
    control.task.report_stop(StopReason(StopCode.BUS, "later"))
    assert control.task.stop_reason == reason


def test_the_first_stop_request_is_kept(control: ControlBlock) -> None:
    control.program.request_stop(StopCode.INTERRUPTED)
    control.program.request_stop(StopCode.RECORDER)
    assert control.program.stop_code == StopCode.INTERRUPTED


@pytest.mark.parametrize("error", [PreflightError("red"), TransportError("gone"), DriverError("x")])
def test_an_error_keeps_its_type_and_text(control: ControlBlock, error: RidDaqError) -> None:
    control.task.fail(error)
    received = control.task.error
    assert type(received) is type(error)
    assert str(received) == str(error)


def test_an_error_keeps_its_notes(control: ControlBlock) -> None:
    error = TransportError("axis3 is silent")
    error.add_note("while leaving the cell: without confirmation that power is off: axis3")
    control.task.fail(error)
    assert error.__notes__[0] in str(control.task.error)


def test_power_counts_as_on_until_power_off_is_confirmed(control: ControlBlock) -> None:
    assert not control.task.power_off
    control.task.power_off = True
    assert control.task.power_off


def test_long_texts_are_shortened_to_fit(control: ControlBlock) -> None:
    control.task.report_stop(StopReason(StopCode.BUS, "ü" * 5000, "j" * 500))
    control.task.fail(DriverError("é\0" * 9000))
    for number in range(1000):
        control.task.add_note(f"note {number}\nof two lines, ü")
    assert control.task.stop_reason is not None
    assert set(control.task.stop_reason.text) == {"ü"}
    assert control.task.notes[0] == "note 0 of two lines, ü"


def test_every_progress_is_a_sign_of_life(control: ControlBlock) -> None:
    before = control.task.beat
    control.task.set_progress(17, Phase.MAIN, 40)
    assert control.task.beat > before
    assert (control.progress.sample_index, control.progress.phase) == (17, Phase.MAIN)


def test_the_task_is_gone_by_its_own_report_or_by_the_programs(control: ControlBlock) -> None:
    control.task.state = TaskState.FINISHED
    assert control.task_gone
    other = ControlBlock.create()
    other.program.declare_task_gone()
    assert other.task_gone
