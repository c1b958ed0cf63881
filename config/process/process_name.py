"""`ProcessName`: what the program's processes are called in `ps`, `top` and /proc."""

from __future__ import annotations

import contextlib
import multiprocessing
from enum import StrEnum
from pathlib import Path


class ProcessName(StrEnum):
    """Names of processes; the kernel keeps 15 characters."""

    TASK = "rid cyclic task"
    RECORDER = "rid recorder"


def set_process_name(name: ProcessName) -> None:
    """Let this process be seen under a name; the program's own process keeps what it has."""
    if multiprocessing.parent_process() is None:
        return
    with contextlib.suppress(OSError):
        Path("/proc/self/comm").write_text(name, encoding="ascii")
