"""`DeviceProcess`: simulated hardware in a separate process, started and ended by the program.

A terminal, a shell or `timeout` sends signals to all processes of a program. They must not end the
simulated hardware, because real hardware does not vanish either when the operator's terminal is
closed. So only the program gets these signals; it stops its robot and then ends the simulated
hardware.
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
from config.process.own_process import new_process
from config.process.termination import SUSPENSION, signals_blocked

SCHEDULER_PRIORITY = 10
"""Real-time priority of simulated hardware; it is lower than that of the cyclic task."""

_START_TIMEOUT_S = 120.0  # includes the compilation of the plant's kernels
_NO_ANSWER = (
    f"no answer within {_START_TIMEOUT_S:.0f} s. If the computer is busy, try again later; parts of"
    " the program that are compiled at the first start are then ready"
)
_END_TIMEOUT_S = 5.0
_PR_SET_TIMERSLACK = 29


class DeviceProcess:
    """A running process, with a pipe for messages.

    Args:
        serve: Main function of the process. Its last argument is the process's end of the pipe,
            through which it reports that it is ready, or the text of an error.
        arguments: The other arguments of `serve`.

    Attributes:
        pipe: The caller's end of the pipe.
    """

    def __init__(self, serve: Callable[..., None], *arguments: Any) -> None:
        self.pipe, theirs = multiprocessing.Pipe()
        self._process = new_process(serve, (*arguments, theirs), daemon=True)
        try:
            with signals_blocked(suspension=True):
                self._process.start()
        except BaseException:
            self.end()
            raise
        finally:
            theirs.close()

    @property
    def pid(self) -> int | None:
        """Process id."""
        return self._process.pid

    def kill(self) -> None:
        """Kill the process."""
        self._process.kill()
        self._process.join()

    def wait_for_end(self, patience_s: float) -> int | None:
        """Wait at most `patience_s` [s]; return the exit code, or None if the process runs."""
        self._process.join(patience_s)
        return self._process.exitcode

    def end(self) -> None:
        """Terminate the process; kill it if it does not end; close the pipe."""
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
    """Wait until a process reports that it is ready; return the port in its report, or None.

    Raises:
        TransportError: The process reports an error, or does not report in time.
    """
    try:
        word: str | int | None = pipe.recv() if pipe.poll(_START_TIMEOUT_S) else _NO_ANSWER
    except (EOFError, OSError):
        word = "the process ended"
    if isinstance(word, str):
        raise TransportError(f"the simulated {what} did not start: {word}", code="RID-MOCK-ENDED")
    return word


def leave_signals_to_parent() -> None:
    """Leave the end of this process to its parent process, which sends SIGTERM.

    The process gets its own process group, so that it does not receive signals to all
    processes of the program: Ctrl-C, Ctrl-Z, a closed terminal, the SIGTERM of `timeout`. It
    ignores interrupts and hang-ups that are sent to it directly, and signals by which a terminal
    suspends background processes. After this call, SIGTERM is no longer blocked.
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

    Real hardware is punctual even if the computer is busy. If the operating system refuses the
    priority, the simulation is less punctual, which is visible in the times of its answers.
    """
    ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
    if realtime:
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(SCHEDULER_PRIORITY))
