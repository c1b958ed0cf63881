from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from config.process.termination import (
    SUSPENSION,
    TERMINATION,
    ending_signals,
    leave_terminal,
    signals_blocked,
    signals_handled,
    suspension_refused,
)


@pytest.mark.parametrize("number", TERMINATION)
def test_five_signals_are_five_requests_and_no_exception(number: signal.Signals) -> None:
    calls: list[int] = []
    before = signal.getsignal(number)
    with signals_handled(lambda: calls.append(1)) as interruption:
        for _ in range(5):
            os.kill(os.getpid(), number)
    assert len(calls) == 5
    assert interruption.signal is number
    assert signal.getsignal(number) is before


def test_signals_stay_ignored_while_data_is_being_written() -> None:
    with signals_handled(lambda: None, then_ignored=True):
        pass
    assert signal.getsignal(signal.SIGINT) is not signal.SIG_IGN, "no signal was handled"
    with signals_handled(lambda: None, then_ignored=True):
        os.kill(os.getpid(), signal.SIGTERM)
    assert {signal.getsignal(number) for number in TERMINATION} == {signal.SIG_IGN}


def test_a_process_of_a_motion_ignores_signals_of_the_terminal_and_its_group(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    handlers, groups = dict[int, object](), list[tuple[int, int]]()
    monkeypatch.setattr(signal, "signal", handlers.__setitem__)
    monkeypatch.setattr(os, "setpgid", lambda pid, group: groups.append((pid, group)))
    monkeypatch.setattr(multiprocessing, "parent_process", object)
    leave_terminal()
    assert handlers == dict.fromkeys((*TERMINATION, *SUSPENSION), signal.SIG_IGN)
    assert groups == [(0, 0)]


def test_a_program_in_motion_cannot_be_suspended(capfd: pytest.CaptureFixture[str]) -> None:
    before = signal.getsignal(signal.SIGTSTP)
    with suspension_refused("refused"):
        assert signal.getsignal(signal.SIGTSTP) is not before
        signal.raise_signal(signal.SIGTSTP)
    assert signal.getsignal(signal.SIGTSTP) is before
    assert "refused" in capfd.readouterr().err


def test_an_interrupt_also_stops_a_program_started_in_the_background() -> None:
    """Background programs of a shell ignore SIGINT; a SIGHUP that `nohup` ignores stays ignored."""
    before = {number: signal.signal(number, signal.SIG_IGN) for number in TERMINATION}
    try:
        assert {*ending_signals()} == {signal.SIGINT, signal.SIGTERM}
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def test_a_process_started_meanwhile_ignores_signals_from_its_first_instruction() -> None:
    script = "import os, signal; os.kill(os.getpid(), signal.SIGINT); print('alive')"
    with signals_blocked():
        child = subprocess.run([sys.executable, "-c", script], capture_output=True, check=True)
    assert child.stdout == b"alive\n"


def test_the_first_process_of_a_program_ignores_signals_too(tmp_path: Path) -> None:
    script = tmp_path / "program.py"
    script.write_text(
        "import os, signal\n"
        "from multiprocessing import get_context\n"
        "from config.process.termination import signals_blocked\n"
        "if __name__ == '__mp_main__':\n"
        "    os.kill(os.getpid(), signal.SIGINT)\n"
        "elif __name__ == '__main__':\n"
        "    process = get_context('spawn').Process(target=print, args=('alive',))\n"
        "    with signals_blocked():\n"
        "        process.start()\n"
        "    process.join()\n"
    )
    child = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
    assert (child.stdout, child.stderr) == ("alive\n", "")


@pytest.mark.parametrize("by_another_thread", [False, True])
def test_a_started_process_is_registered_before_a_signal_is_handled(
    by_another_thread: bool,
) -> None:
    events: list[object] = []
    signal.signal(signal.SIGHUP, lambda number, _frame: events.append(number))

    def start_something() -> None:
        with signals_blocked():
            for number in (signal.SIGINT, signal.SIGHUP):
                if by_another_thread:
                    other.submit(signal.raise_signal, number).result()
                else:
                    signal.raise_signal(number)
            events.append("noted")

    with ThreadPoolExecutor(1) as other:
        other.submit(int).result()  # the thread runs and can receive signals
        with pytest.raises(KeyboardInterrupt):
            start_something()
    assert events == ["noted", signal.SIGHUP], "SIGHUP was not handled after the exception"
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert not signal.pthread_sigmask(signal.SIG_BLOCK, ())


def test_outside_the_main_thread_signals_wait_too() -> None:
    def started_there() -> bool:
        with signals_blocked():
            return set(TERMINATION) <= signal.pthread_sigmask(signal.SIG_BLOCK, ())

    with ThreadPoolExecutor(1) as other:
        assert other.submit(started_there).result()
