"""`run_program`: runs a command of rid-daq in its own process, with a limit of time."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence


def run_program(words: Sequence[str], longest_s: float) -> tuple[int, str, str]:
    """Return the exit status of a command (124 after the limit), its output and its messages."""
    try:
        done = subprocess.run(
            [sys.executable, "-m", "rid_daq", *words],
            capture_output=True,
            text=True,
            timeout=longest_s,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return 124, "", f"still running after {longest_s:g} s"
    return done.returncode, done.stdout, done.stderr


def ended_programs_s() -> float:
    """Return the processor time of all programs that have ended [s]."""
    times = os.times()
    return times.children_user + times.children_system
