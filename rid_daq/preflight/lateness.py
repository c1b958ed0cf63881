"""How late sleeps end: measured in a process that asks for all that the cyclic task asks for.

The process begins by importing this file: what it need not know costs every preflight a second.
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


def lateness() -> str:
    """Return the median and the worst of some sleeps, in words."""
    context = multiprocessing.get_context("spawn")
    pipe, theirs = context.Pipe()
    process = context.Process(target=sleep_like_the_task, args=(theirs,), daemon=True)
    try:
        with signals_blocked():
            process.start()
        theirs.close()
        late_s: list[float] = pipe.recv()
    except EOFError:  # it was killed
        return "not measured"
    finally:
        pipe.close()
        if process.pid is not None:
            process.kill()
            process.join()
    late_s.sort()
    return f"{1e3 * late_s[_SLEEPS // 2]:.3f} ms, {1e3 * late_s[-1]:.2f} ms"


def sleep_like_the_task(pipe: Connection) -> None:
    """Sleep again and again, the main function of a process; send how late each sleep ended [s]."""
    ignore_termination()
    request_realtime()
    clock = MonotonicClock()
    late_s = []
    for _ in range(_LEARNING + _SLEEPS):
        due_s = clock.now_s() + _SLEEP_S
        clock.sleep_until(due_s)
        late_s.append(clock.now_s() - due_s)
    with contextlib.suppress(OSError):  # a program that was interrupted does not wait for it
        pipe.send(late_s[_LEARNING:])
