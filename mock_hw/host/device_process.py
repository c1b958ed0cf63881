"""`DeviceProcess`: simulated hardware in a separate process, started and ended by the program.

Signals that a terminal, a shell or `timeout` sends to all processes of a program reach only the
program itself. The program then stops its robot first; real hardware would not vanish with the
operator's terminal either.
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
"""Lower than the priority of the cyclic task."""

_START_TIMEOUT_S = 120.0  # the plant's kernels may need compilation
_END_TIMEOUT_S = 5.0
_PR_SET_TIMERSLACK = 29


class DeviceProcess:
    """A started process with a pipe to it.

    Args:
        serve: Main function of the process. Its last argument is the process's end of the pipe,
            through which it reports that it serves, or the text of an error.
        arguments: The other arguments of `serve`.

    Attributes:
        pipe: The caller's end of the pipe.
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
        """Terminate the process, kill it if it does not end, and close the pipe."""
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
    """Wait for the report that a process serves, and return its port or None.

    Raises:
        TransportError: The report is the text of an error, or there is no report.
    """
    try:
        word: str | int | None = pipe.recv() if pipe.poll(_START_TIMEOUT_S) else "no answer"
    except (EOFError, OSError):
        word = "the process ended"
    if isinstance(word, str):
        raise TransportError(f"the simulated {what} did not start: {word}", code="RID-MOCK-ENDED")
    return word


def leave_signals_to_parent() -> None:
    """Ensure that only the parent process ends this process, after it has stopped the robot.

    A process group of its own keeps away the signals to all processes of a program: Ctrl-C, Ctrl-Z,
    a closed terminal, the SIGTERM of `timeout`. Interrupts and hang-ups to this process itself are
    ignored, and so are the signals by which a terminal stops background processes. From here on,
    SIGTERM ends the process.
    """
    os.setpgid(0, 0)
    for number in (signal.SIGINT, signal.SIGHUP, *SUSPENSION):
        signal.signal(number, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGTERM])


def catch_terminate() -> int:
    """Return a file descriptor that becomes readable after SIGTERM."""
    readable, writable = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
    signal.signal(signal.SIGTERM, lambda _number, _frame: None)
    signal.set_wakeup_fd(writable, warn_on_full_buffer=False)
    return readable


def request_exact_timing(realtime: bool) -> None:
    """Request exact timers and, in real time, a real-time scheduling priority.

    A real bus and real drives do not wait for a loaded computer. If the system refuses the
    priority, the simulation is less punctual; the times of its answers show this.
    """
    ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
    if realtime:
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(SCHEDULER_PRIORITY))
