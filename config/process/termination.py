"""Termination signals: the program turns them into a request to stop, its processes ignore them."""

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
"""What a terminal suspends processes by: Ctrl-Z, and reading or writing in the background."""


def ending_signals() -> tuple[signal.Signals, ...]:
    """Return the signals that end this program.

    A hang-up that is ignored stays ignored: that is what `nohup` asks for. An interrupt never does:
    shells start background commands with it ignored, which nobody asked for, and who sends one
    wants the robot to stop.
    """
    nohup = signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    return tuple(each for each in TERMINATION if not (nohup and each == signal.SIGHUP))


def ignore_termination() -> None:
    """Ignore Ctrl-C, SIGTERM and a closed terminal: the program alone decides when to stop."""
    for number in TERMINATION:
        signal.signal(number, signal.SIG_IGN)


def leave_terminal() -> None:
    """Let this process go on whatever the terminal does; first of all in its main function.

    Beside ignoring what ends the program, it leaves the program's process group: Ctrl-Z, or any
    signal to the group, suspends or kills nothing that a stop needs. It can write to the terminal
    from there. A program's own process, which is no part of it, stays where it is.
    """
    ignore_termination()
    if multiprocessing.parent_process() is None:
        return
    for number in SUSPENSION:
        signal.signal(number, signal.SIG_IGN)
    os.setpgid(0, 0)


@contextlib.contextmanager
def suspension_refused(why: str) -> Iterator[None]:
    """Answer Ctrl-Z with a sentence on standard error instead of being suspended.

    Outside the main thread, which alone may handle signals, nothing is changed.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def tell(_number: int, _frame: FrameType | None) -> None:
        with contextlib.suppress(OSError):
            os.write(2, f"\n{why}\n".encode())

    before = signal.signal(signal.SIGTSTP, tell)
    try:
        yield
    finally:
        signal.signal(signal.SIGTSTP, before)


class Interruption:
    """The first termination signal that came, if any; later ones change nothing."""

    def __init__(self) -> None:
        self.signal: signal.Signals | None = None


@contextlib.contextmanager
def signals_handled(
    stop: Callable[[], None], *, then_ignored: bool = False
) -> Iterator[Interruption]:
    """Call `stop` at every termination signal instead of dying, however many come.

    Outside the main thread, which alone may handle signals, nothing is changed.

    Args:
        stop: Called in the main thread, between two of its instructions.
        then_ignored: Whether, once a signal came, further ones are ignored at the end as well: the
            caller has still to write down what was stopped.

    Yields:
        Says which signal came first.
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
    """Start processes in here: they start with termination signals blocked.

    They are from their first instruction, and no owner is interrupted before it has noted what it
    started. With `suspension`, for those that `leave_terminal`, Ctrl-Z is blocked too.
    """
    resource_tracker.ensure_running()  # starting the first process would unblock signals again
    with signals_deferred():
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, SUSPENSION if suspension else ())
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)


@contextlib.contextmanager
def signals_deferred() -> Iterator[None]:
    """Let termination signals wait until the end of the `with`.

    The mask alone is not enough: the kernel hands a signal to any other thread, for which Python
    then interrupts the main thread.
    """
    came: list[int] = []
    with contextlib.ExitStack() as at_end:
        at_end.callback(_raise_all, came)
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, TERMINATION)
        at_end.callback(signal.pthread_sigmask, signal.SIG_SETMASK, mask)
        if threading.current_thread() is threading.main_thread():
            for number in TERMINATION:
                handler = signal.getsignal(number)
                if handler not in (signal.SIG_IGN, None):  # as nohup leaves it
                    signal.signal(number, lambda came_in, _frame: came.append(came_in))
                    at_end.callback(signal.signal, number, handler)
        yield


def _raise_all(signals: list[int]) -> None:
    """Let this program have signals, all of them, even where one raises an exception."""
    with contextlib.ExitStack() as stack:
        for number in reversed(signals):
            stack.callback(signal.raise_signal, number)
