"""Processes as forks of a server process that has imported their modules.

A new Python process imports its modules first; a simulated device also prepares numba. The tests
start hundreds of processes, so a server does this once for all tests of a worker. The server is a
new Python process: it has no threads and no state of a test.

Tests of starts, of resource limits, and of faults of child processes use `new_processes`. Programs
that a test starts, such as services, always start new processes.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator
from contextlib import chdir, contextmanager
from multiprocessing import forkserver, reduction
from multiprocessing.context import ForkServerProcess
from typing import Any

import pytest

from config.process import own_process
from tests.builders.code_lines import ROOT

PREPARED = "tests.builders.prepared_processes"


class ForkedProcess(ForkServerProcess):
    """Process with the working folder, environment variables and outputs of its starter.

    Resource limits are those of the server.

    Args:
        target: Main function of the process.
        args: Its arguments.
        name: Name of the process within Python.
        daemon: True if the process ends with its starter.
    """

    def __init__(
        self,
        *,
        target: Callable[..., None],
        args: tuple[Any, ...],
        name: str | None = None,
        daemon: bool = False,
    ) -> None:
        arguments = (dict(os.environ), _Outputs(), target, args)
        super().__init__(target=_call, args=arguments, name=name, daemon=daemon)

    def start(self) -> None:
        """Start the process; start the server first if it does not run."""
        with chdir(ROOT):  # the server imports `PREPARED` from its start folder
            forkserver.ensure_running()
        super().start()


class _Outputs:
    """Standard output and error output; the new process receives a list of duplicates."""

    def __reduce__(self) -> tuple[Any, ...]:
        return list, ((reduction.DupFd(1), reduction.DupFd(2)),)


def _call(
    variables: dict[str, str],
    outputs: list[Any],
    target: Callable[..., None],
    args: tuple[Any, ...],
) -> None:
    """Call the main function with the environment variables and outputs of the starter.

    `os.getppid` then returns the id of the starter, and not of the server.
    """
    os.environ.clear()
    os.environ.update(variables)
    for number, output in enumerate(outputs, start=1):
        os.dup2(output.detach(), number)
    os.getppid = _parent_pid
    target(*args)


def _parent_pid() -> int:
    """Return the id of the process that started this process, or 1 if it has ended."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    assert parent.pid is not None
    return parent.pid if parent.is_alive() else 1


def fork_processes() -> None:
    """Let this process start other processes as forks."""
    forkserver.set_forkserver_preload([PREPARED])
    setattr(own_process, "NewProcess", ForkedProcess)  # noqa: B010


@contextmanager
def new_processes() -> Iterator[None]:
    """Let this process start new Python processes, as the program does, in a `with` block."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(own_process, "NewProcess", multiprocessing.get_context("spawn").Process)
        yield
