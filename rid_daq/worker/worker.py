"""The life of a worker: ready, told one job, does it, and says how it ended."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO

from pydantic import BaseModel, ConfigDict

from acquisition.task.service_beat import ServiceBeat
from config.formats.approved_files import approve_files
from config.process.termination import TERMINATION, signals_deferred
from rid_daq.app import Ending, end_by_signals, ending_of
from rid_daq.operations.catalogue import operation
from rid_daq.operations.perform import perform
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.request_check import request_of, require_ending
from rid_daq.terminal.console import make_printable
from rid_daq.terminal.job_events import Ended
from rid_daq.worker.job_console import EventFile, JobConsole
from rid_daq.worker.orders import Orders


class WorkOrder(BaseModel):
    """First line on a worker's standard input.

    Attributes:
        kind: Kind of the job.
        request: Request of the client.
        cell: The cell, a bundled name or a file.
        runs, folder, events: Folder of the run folders, folder of relative paths, file of the
            events.
        cleared: True if a person has just confirmed that the cell is clear.
        owner: Person or program that started the job.
        niceness: Nice value of the process.
        approved: SHA-256 of the files with which the job was accepted, by their paths.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: JobKind
    request: dict[str, object]
    cell: str
    runs: Path
    folder: Path
    events: Path
    cleared: bool
    owner: str = ""
    niceness: int = 0
    approved: dict[str, str] = {}


def main() -> int:
    """Wait for the job on standard input, do it, and return its exit code.

    The argument is the descriptor of the service's signs of life (`ServiceBeat`). A signal that
    comes before the job can say how it ended is held back until then.
    """
    service = ServiceBeat.inherited(int(sys.argv[1]))
    os.set_inheritable(service.descriptor, False)
    with contextlib.ExitStack() as deferral:
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, TERMINATION)  # none between the next two
        deferral.callback(signal.pthread_sigmask, signal.SIG_SETMASK, mask)
        end_by_signals()
        deferral.enter_context(signals_deferred())
        _warm_up()
        line = sys.stdin.readline()
        if not line:
            return 0
        order = WorkOrder.model_validate_json(line)
        return work(order, sys.stdin, service, let_signals_in=deferral.close)


def _let_in() -> None:
    """Do nothing: signals come in already."""


def work(
    order: WorkOrder,
    source: IO[str],
    service: ServiceBeat | None = None,
    *,
    let_signals_in: Callable[[], None] = _let_in,
) -> int:
    """Do a job; its end is the last of its events.

    Args:
        order: The job.
        source: Where further orders come from.
        service: Signs of life of the service.
        let_signals_in: Called once a signal may end the job.
    """
    os.chdir(order.folder)
    approve_files(order.approved)
    os.nice(order.niceness)
    with EventFile(order.events) as events:
        orders = Orders(source, service=service)
        console = JobConsole(events=events, orders=orders)

        def job() -> None:
            operation = order.kind.operation  # an import that a signal ends is a mistake
            let_signals_in()
            request = request_of(
                order.kind,
                order.request,
                cell=order.cell,
                runs=str(order.runs),
                cleared=order.cleared,
                tester=order.owner,
            )
            require_ending(order.kind, order.request)
            perform(operation, request, console)

        orders.start()
        try:
            ending = ending_of(job)
        except BaseException as error:
            ending = Ending(1, "Mistake", f"of the program: {type(error).__name__}: {error}")
            events.write(_ended(ending))
            raise
        events.write(_ended(ending))
    return ending.code


def _ended(ending: Ending) -> Ended:
    return Ended(
        at_s=time.time(),
        exit_code=ending.code,
        error=ending.kind or None,
        message=make_printable(ending.message) or None,
        code=ending.refusal or None,
    )


def _warm_up() -> None:
    """Import what most jobs need, so that a job begins at once."""
    for name in ("record", "identify", "check"):
        operation(name).load()
