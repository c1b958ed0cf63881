"""Measure how late sleeps end, in a process with the privileges of the cyclic task.

The new process imports this file, so every unneeded import would delay each preflight.
"""

from __future__ import annotations

import contextlib
import multiprocessing
from multiprocessing.connection import Connection
from typing import Final

from acquisition.task.realtime import request_realtime
from config.process.termination import ignore_termination, signals_blocked
from drivers.ports.clock import MonotonicClock

_LEARNING: Final = 150
_SLEEPS: Final = 50
_SLEEP_S: Final = 0.002


def measure_lateness() -> str:
    """Return a text with the median and the largest lateness of some sleeps."""
    context = multiprocessing.get_context("spawn")
    pipe, theirs = context.Pipe()
    process = context.Process(target=sleep_like_the_task, args=(theirs,), daemon=True)
    try:
        with signals_blocked():
            process.start()
        theirs.close()
        late_s: list[float] = pipe.recv()
    except EOFError:  # the process was killed
        return "not measured"
    finally:
        pipe.close()
        if process.pid is not None:
            process.kill()
            process.join()
    late_s.sort()
    return f"{1e3 * late_s[_SLEEPS // 2]:.3f} ms, {1e3 * late_s[-1]:.2f} ms"


def sleep_like_the_task(pipe: Connection) -> None:
    """Sleep repeatedly and send the lateness of each sleep [s] (main function of a process)."""
    ignore_termination()
    request_realtime()
    clock = MonotonicClock()
    late_s = []
    for _ in range(_LEARNING + _SLEEPS):
        due_s = clock.now_s() + _SLEEP_S
        clock.sleep_until(due_s)
        late_s.append(clock.now_s() - due_s)
    with contextlib.suppress(OSError):  # if the parent process was interrupted, the pipe is closed
        pipe.send(late_s[_LEARNING:])
