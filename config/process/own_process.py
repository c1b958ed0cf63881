"""Properties of rid-daq's processes: start command, name, garbage collection."""

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
    """Set this process's name, as shown by ps; the main process keeps its name."""
    if multiprocessing.parent_process() is None:
        return
    with contextlib.suppress(OSError):
        Path("/proc/self/comm").write_text(name, encoding="ascii")


def own_python(module: str, *arguments: str) -> list[str]:
    """Return the command line that runs a module of this program.

    Files in the start folder, such as `config.py` or a folder `drivers`, do not shadow modules of
    rid-daq (`python -P`).

    Args:
        module: The module to run, such as `rid_daq.worker`.
    """
    return [sys.executable, "-P", "-m", module, *arguments]


def keep_from_collections() -> None:
    """Exclude all objects that exist now from garbage collection.

    A full collection visits every object: 50 to 100 ms for a server's hundred thousand objects,
    during which a stop would wait. Objects that are created later are collected as usual.
    """
    gc.collect()
    gc.freeze()
