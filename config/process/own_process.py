"""Properties of rid-daq's processes: start, name, garbage collection."""

from __future__ import annotations

import contextlib
import gc
import multiprocessing
import sys
from collections.abc import Callable
from enum import StrEnum
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

NewProcess: type[BaseProcess] = multiprocessing.get_context("spawn").Process
"""Class of new processes; tests replace it, because a new Python process starts slowly."""


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


def new_process(
    main: Callable[..., None],
    arguments: tuple[Any, ...],
    *,
    name: str | None = None,
    daemon: bool = False,
) -> BaseProcess:
    """Return a new Python process, not started.

    Args:
        main: Main function of the process.
        arguments: Arguments of the main function.
        name: Name of the process within Python; None for a numbered name.
        daemon: True if Python terminates the process when this process ends.
    """
    return NewProcess(target=main, args=arguments, name=name, daemon=daemon)


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
