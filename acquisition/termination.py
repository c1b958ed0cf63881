"""Termination signals: the program turns them into a request to stop, its processes ignore them."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from types import FrameType

TERMINATION = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def ignore_termination() -> None:
    """Ignore Ctrl-C, SIGTERM and a closed terminal: the program alone decides when to stop."""
    for number in TERMINATION:
        signal.signal(number, signal.SIG_IGN)


class Interruption:
    """The first termination signal that came, if any; later ones change nothing."""

    def __init__(self) -> None:
        self.signal: signal.Signals | None = None


@contextmanager
def termination_calls(
    stop: Callable[[], None], *, then_ignored: bool = False
) -> Iterator[Interruption]:
    """Call `stop` at every termination signal instead of dying, however many come.

    Outside the main thread, which alone may handle signals, nothing is changed.

    Parameters
    ----------
    stop
        Called in the main thread, between two of its instructions.
    then_ignored
        Whether, once a signal came, further ones are ignored at the end as well: the caller has
        still to write down what was stopped.

    Yields
    ------
    Interruption
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

    before = {number: signal.signal(number, handle) for number in TERMINATION}
    try:
        yield interruption
    finally:
        ignored = then_ignored and interruption.signal is not None
        for number, handler in before.items():
            signal.signal(number, signal.SIG_IGN if ignored else handler)


@contextmanager
def termination_held() -> Iterator[None]:
    """Start processes in here: they are deaf to termination signals from the first instruction."""
    resource_tracker.ensure_running()  # starting the first process would unblock signals again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, TERMINATION)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
