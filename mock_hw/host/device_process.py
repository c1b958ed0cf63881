"""`DeviceProcess`: simulated hardware in a process of its own, started and ended by the program.

What a terminal, a shell or `timeout` sends to all processes of a program reaches the program alone,
which stops its robot first: hardware does not vanish with the operator's terminal.
"""

from __future__ import annotations

import contextlib
import ctypes
import multiprocessing
import os
import signal
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from config.errors import TransportError
from config.process.termination import SUSPENSION, signals_blocked

SCHEDULER_PRIORITY = 10
"""Below the cyclic task's own."""

_START_TIMEOUT_S = 120.0  # the plant's kernels may have to be compiled
_END_TIMEOUT_S = 5.0
_PR_SET_TIMERSLACK = 29


class DeviceProcess:
    """A started process, and the pipe to it.

    Args:
        serve: Its main function; its last argument is its end of the pipe, through which it says
            that it serves, or what went wrong.
        arguments: The arguments before that.

    Attributes:
        pipe: Our end.
    """

    def __init__(self, serve: Callable[..., None], *arguments: Any) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self._process = context.Process(target=serve, args=(*arguments, theirs), daemon=True)
        try:
            with signals_blocked(suspension=True):
                self._process.start()
        except BaseException:
            self.end()
            raise
        finally:
            theirs.close()

    def end(self) -> None:
        """End the process, gently first, and close the pipe."""
        process = self._process
        if process.pid is not None:
            process.terminate()
            process.join(_END_TIMEOUT_S)
            if process.is_alive():
                process.kill()
                process.join()
        process.close()
        self.pipe.close()


def wait_until_ready(what: str, pipe: Connection) -> int | None:
    """Wait for the word that somebody serves: a port, or nothing.

    Raises:
        TransportError: The word is a text, which says what went wrong, or there is none.
    """
    try:
        word: str | int | None = pipe.recv() if pipe.poll(_START_TIMEOUT_S) else "no answer"
    except (EOFError, OSError):
        word = "the process ended"
    if isinstance(word, str):
        raise TransportError(f"the simulated {what} did not start: {word}", code="RID-MOCK-ENDED")
    return word


def leave_signals_to_parent() -> None:
    """Let this process be ended by its starter alone: the starter stops the robot first.

    A process group of its own keeps away what is sent to all of a program's processes: Ctrl-C,
    Ctrl-Z, a closed terminal, the SIGTERM of `timeout`. Interrupts and hang-ups that are sent to
    this process itself are ignored, and so is a terminal's refusal to let it write; SIGTERM is how
    it is ended, from here on.
    """
    os.setpgid(0, 0)
    for number in (signal.SIGINT, signal.SIGHUP, *SUSPENSION):
        signal.signal(number, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGTERM])


def catch_terminate() -> int:
    """Return a descriptor that is readable after SIGTERM."""
    readable, writable = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
    signal.signal(signal.SIGTERM, lambda _number, _frame: None)
    signal.set_wakeup_fd(writable, warn_on_full_buffer=False)
    return readable


def keep_pace(realtime: bool) -> None:
    """Ask for exact timers and, in real time, to be scheduled before ordinary programs.

    A real bus and real drives do not wait for a loaded computer. Where the system refuses, the
    simulation is as punctual as it can be; the answers' times tell.
    """
    ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
    if realtime:
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(SCHEDULER_PRIORITY))
