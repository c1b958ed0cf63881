"""`run_program`: runs a command of rid-daq in its own process, with limits of time."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from typing import Final

_LIMITED: Final = ("sh", "-c", 'ulimit -t "$0" && exec "$@"')
_WAITING: Final = 10
"""Factor between the limits of elapsed time and of processor time: on a busy computer, a program of
low priority gets a small part of the processor's time.
"""


def run_program(words: Sequence[str], longest_cpu_s: int) -> tuple[int, str, str]:
    """Return the exit status of a command (124 after a limit), its output and its messages.

    Args:
        words: Command and its arguments.
        longest_cpu_s: Limit of the processor time of each of its processes; a command that waits
            without computing ends after ten times as long.
    """
    try:
        done = subprocess.run(
            [*_LIMITED, str(longest_cpu_s), sys.executable, "-m", "rid_daq", *words],
            capture_output=True,
            text=True,
            timeout=_WAITING * longest_cpu_s,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return 124, "", f"still running after {_WAITING * longest_cpu_s} s"
    if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return 124, "", f"still running after {longest_cpu_s} s of processor time"
    return done.returncode, done.stdout, done.stderr


def ended_programs_s() -> float:
    """Return the processor time of all programs that have ended [s]."""
    times = os.times()
    return times.children_user + times.children_system
