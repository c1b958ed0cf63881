from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from acquisition.control_block import ControlBlock, TaskState
from acquisition.motion_samples import Phase
from acquisition.stop_reason import StopCode, StopReason
from acquisition.termination import TERMINATION, termination_calls, termination_held
from config.errors import DriverError, PreflightError, RidDaqError, TransportError


@pytest.fixture
def control() -> ControlBlock:
    return ControlBlock.create()


def test_a_fresh_block_says_nothing(control: ControlBlock) -> None:
    assert control.stop_reason is None
    assert control.task_error is None
    assert control.stop_code == 0
    assert control.notes == ()
    assert not control.task_gone
    assert control.progress.state is TaskState.STARTING
    assert control.progress.sample_index == -1


def test_the_first_reason_to_stop_stays(control: ControlBlock) -> None:
    reason = StopReason(StopCode.FOLLOWING_ERROR, "off by 0.1 rad · é", "joint2", 0.1, 0.05)
    control.report_stop(reason)
    control.report_stop(StopReason(StopCode.BUS, "later"))
    assert control.stop_reason == reason


def test_the_first_request_counts(control: ControlBlock) -> None:
    control.request_stop(StopCode.INTERRUPTED)
    control.request_stop(StopCode.RECORDER)
    assert control.stop_code == StopCode.INTERRUPTED


@pytest.mark.parametrize("error", [PreflightError("red"), TransportError("gone"), DriverError("x")])
def test_an_error_arrives_as_what_it_was(control: ControlBlock, error: RidDaqError) -> None:
    control.report_error(error)
    received = control.task_error
    assert type(received) is type(error)
    assert str(received) == str(error)


def test_texts_of_any_length_fit(control: ControlBlock) -> None:
    control.report_stop(StopReason(StopCode.BUS, "ü" * 5000, "j" * 500))
    control.report_error(DriverError("é\0" * 9000))
    for number in range(1000):
        control.add_note(f"note {number}\nof two lines, ü")
    assert control.stop_reason is not None
    assert set(control.stop_reason.text) == {"ü"}
    assert control.notes[0] == "note 0 of two lines, ü"


def test_every_progress_is_a_sign_of_life(control: ControlBlock) -> None:
    before = control.task_beat
    control.set_progress(17, Phase.MAIN, 40)
    assert control.task_beat > before
    assert (control.progress.sample_index, control.progress.phase) == (17, Phase.MAIN)


def test_the_task_is_gone_by_its_own_word_or_the_programs(control: ControlBlock) -> None:
    control.task_state = TaskState.FINISHED
    assert control.task_gone
    other = ControlBlock.create()
    other.declare_task_gone()
    assert other.task_gone


@pytest.mark.parametrize("number", TERMINATION)
def test_five_signals_are_five_requests_and_no_exception(number: signal.Signals) -> None:
    calls: list[int] = []
    before = signal.getsignal(number)
    with termination_calls(lambda: calls.append(1)) as interruption:
        for _ in range(5):
            os.kill(os.getpid(), number)
    assert len(calls) == 5
    assert interruption.signal is number
    assert signal.getsignal(number) is before


def test_signals_stay_ignored_where_something_is_left_to_be_written() -> None:
    with termination_calls(lambda: None, then_ignored=True):
        pass
    assert signal.getsignal(signal.SIGINT) is not signal.SIG_IGN, "none came"
    with termination_calls(lambda: None, then_ignored=True):
        os.kill(os.getpid(), signal.SIGTERM)
    assert {signal.getsignal(number) for number in TERMINATION} == {signal.SIG_IGN}


def test_a_process_started_meanwhile_is_deaf_from_its_first_instruction() -> None:
    script = "import os, signal; os.kill(os.getpid(), signal.SIGINT); print('alive')"
    with termination_held():
        child = subprocess.run([sys.executable, "-c", script], capture_output=True, check=True)
    assert child.stdout == b"alive\n"


def test_so_is_the_first_process_of_a_program(tmp_path: Path) -> None:
    script = tmp_path / "program.py"
    script.write_text(
        "import os, signal\n"
        "from multiprocessing import get_context\n"
        "from acquisition.termination import termination_held\n"
        "if __name__ == '__mp_main__':\n"
        "    os.kill(os.getpid(), signal.SIGINT)\n"
        "elif __name__ == '__main__':\n"
        "    process = get_context('spawn').Process(target=print, args=('alive',))\n"
        "    with termination_held():\n"
        "        process.start()\n"
        "    process.join()\n"
    )
    child = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
    assert (child.stdout, child.stderr) == ("alive\n", "")
