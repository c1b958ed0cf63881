"""A process of this program: how it is started, what it is called, when it collects garbage."""

from __future__ import annotations

import contextlib
import gc
import multiprocessing
import sys
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


def own_python(module: str, *arguments: str) -> list[str]:
    """Return the command line that runs a module of this program.

    What lies in the folder where it starts, a `config.py` or a folder `drivers`, is not taken for
    ours (`python -P`).

    Args:
        module: The module that is run, `rid_daq.worker`.
        *arguments: Its arguments.
    """
    return [sys.executable, "-P", "-m", module, *arguments]


def keep_from_collections() -> None:
    """Leave all that a process has imported and made so far out of its collections of garbage.

    A full one goes through every object: 50 to 100 ms for a server's hundred thousand, in which a
    stop would wait. What is made afterwards is collected as ever.
    """
    gc.collect()
    gc.freeze()
