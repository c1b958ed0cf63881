"""Termination signals: the program turns them into a stop request, its processes ignore them."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from multiprocessing import resource_tracker
from types import FrameType

TERMINATION = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
SUSPENSION = (signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU)
"""Signals by which a terminal suspends processes: Ctrl-Z, background input and output."""


def ending_signals() -> tuple[signal.Signals, ...]:
    """Return the signals that end this program.

    An ignored hang-up (SIGHUP) stays ignored, as `nohup` intends. An interrupt (SIGINT) is handled
    even if it was ignored: shells start background commands with interrupts ignored, but a person
    who sends an interrupt wants the robot to stop.
    """
    nohup = signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    return tuple(each for each in TERMINATION if not (nohup and each == signal.SIGHUP))


def ignore_termination() -> None:
    """Ignore Ctrl-C, SIGTERM and a closed terminal: only the program decides when to stop."""
    for number in TERMINATION:
        signal.signal(number, signal.SIG_IGN)


def leave_terminal() -> None:
    """Make this process independent of the terminal; call it first in the main function.

    It ignores termination signals and leaves the program's process group. Ctrl-Z or any signal to
    the group then does not suspend or kill a process that is needed for a stop. The process can
    still write to the terminal. The main process, which is not a child process, stays in its group.
    """
    ignore_termination()
    if multiprocessing.parent_process() is None:
        return
    for number in SUSPENSION:
        signal.signal(number, signal.SIG_IGN)
    os.setpgid(0, 0)


@contextlib.contextmanager
def suspension_refused(why: str) -> Iterator[None]:
    """Answer Ctrl-Z with a message on standard error instead of suspending.

    Outside the main thread nothing changes, because only the main thread can handle signals.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def refuse(_number: int, _frame: FrameType | None) -> None:
        with contextlib.suppress(OSError):
            os.write(2, f"\n{why}\n".encode())

    before = signal.signal(signal.SIGTSTP, refuse)
    try:
        yield
    finally:
        signal.signal(signal.SIGTSTP, before)


class Interruption:
    """The first termination signal; None before it arrives. Later signals do not change it."""

    def __init__(self) -> None:
        self.signal: signal.Signals | None = None


@contextlib.contextmanager
def signals_handled(
    stop: Callable[[], None], *, then_ignored: bool = False
) -> Iterator[Interruption]:
    """Call `stop` at every signal of `ending_signals`, instead of ending the program.

    Outside the main thread nothing changes, because only the main thread can handle signals.

    Args:
        stop: Called in the main thread, between two of its instructions.
        then_ignored: If True and a signal came, further signals stay ignored after the `with`
            block, because the caller still has to record the stop.

    Yields:
        The first signal, once one has arrived.
    """
    interruption = Interruption()
    if threading.current_thread() is not threading.main_thread():
        yield interruption
        return

    def handle(number: int, frame: FrameType | None) -> None:
        if interruption.signal is None:
            interruption.signal = signal.Signals(number)
        stop()

    before = {number: signal.signal(number, handle) for number in ending_signals()}
    try:
        yield interruption
    finally:
        ignored = then_ignored and interruption.signal is not None
        for number, handler in before.items():
            signal.signal(number, signal.SIG_IGN if ignored else handler)


@contextlib.contextmanager
def signals_blocked(*, suspension: bool = False) -> Iterator[None]:
    """Block termination signals in processes that are started in the `with` block.

    The signals are blocked from the process's first instruction. The starting process is not
    interrupted before it has recorded the new process. With `suspension`, for processes that call
    `leave_terminal`, Ctrl-Z is blocked too.
    """
    # start Python's resource tracker now: its start would unblock the signals again
    resource_tracker.ensure_running()
    with signals_deferred():
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, SUSPENSION if suspension else ())
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)


@contextlib.contextmanager
def signals_deferred() -> Iterator[None]:
    """Delay termination signals until the end of the `with` block.

    The signal mask alone is not enough: the kernel delivers a signal to any other thread, and
    Python then interrupts the main thread.
    """
    received: list[int] = []
    with contextlib.ExitStack() as at_end:
        at_end.callback(_raise_all, received)
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, TERMINATION)
        at_end.callback(signal.pthread_sigmask, signal.SIG_SETMASK, mask)
        if threading.current_thread() is threading.main_thread():
            for number in TERMINATION:
                handler = signal.getsignal(number)
                # the signal is already ignored, for example by nohup
                if handler not in (signal.SIG_IGN, None):
                    signal.signal(number, lambda caught, _frame: received.append(caught))
                    at_end.callback(signal.signal, number, handler)
        yield


def _raise_all(signals: list[int]) -> None:
    """Raise all signals again, even if the handler of one raises an exception."""
    with contextlib.ExitStack() as stack:
        for number in reversed(signals):
            stack.callback(signal.raise_signal, number)
