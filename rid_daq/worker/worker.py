"""Life of a worker: forked from the template, it executes a job and writes how the job ended."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO

from pydantic import BaseModel, ConfigDict

from acquisition.task.service_beat import ServiceBeat
from config.formats.approved_files import approve_files
from config.load import load_cell
from config.process.own_process import keep_from_collections
from config.process.termination import TERMINATION, signals_deferred
from dynamics.model.robot_model import RobotModel
from identification.model.base_parameters import base_parameters
from rid_daq.app import Ending, end_by_signals, ending_of
from rid_daq.operations.catalogue import operation
from rid_daq.operations.perform import perform
from rid_daq.report_page.render import load_templates
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.request_check import parse_request, require_ending
from rid_daq.session.ownership import accept_owner
from rid_daq.terminal.console import make_printable
from rid_daq.terminal.job_events import EndEvent
from rid_daq.worker.job_console import EventFile, JobConsole
from rid_daq.worker.orders import Orders
from rid_daq.worker.template import fork_workers


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
        service: Process id of the service.
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
    service: int
    niceness: int = 0
    approved: dict[str, str] = {}


def main() -> int:
    """Import what jobs need, and fork workers for the service until it ends.

    The argument is the file descriptor of the connection to the service.
    """
    line = socket.socket(fileno=int(sys.argv[1]))
    line.set_inheritable(False)
    _warm_up()
    keep_from_collections()
    try:
        descriptor = fork_workers(line)
    except BrokenPipeError:  # the service ended before it read a report
        return 0
    return 0 if descriptor is None else run_worker(ServiceBeat.from_descriptor(descriptor))


def run_worker(service: ServiceBeat) -> int:
    """Wait for the job on standard input, execute it, and return its exit code.

    A signal is deferred until the job can write how it ended.
    """
    with contextlib.ExitStack() as deferral:
        mask = signal.pthread_sigmask(
            signal.SIG_BLOCK, TERMINATION
        )  # no signal may arrive between the next two calls
        deferral.callback(signal.pthread_sigmask, signal.SIG_SETMASK, mask)
        end_by_signals()
        deferral.enter_context(signals_deferred())
        line = sys.stdin.readline()
        if not line:
            return 0
        order = WorkOrder.model_validate_json(line)
        return work(order, sys.stdin, service, allow_signals=deferral.close)


def _do_nothing() -> None:
    """Default of `allow_signals`, if no signals are deferred."""


def work(
    order: WorkOrder,
    source: IO[str],
    service: ServiceBeat | None = None,
    *,
    allow_signals: Callable[[], None] = _do_nothing,
) -> int:
    """Execute a job and return its exit code; its last event says how it ended.

    Args:
        order: The job.
        source: Source of further orders.
        service: Heartbeat of the service.
        allow_signals: Function that is called once a signal may end the job.
    """
    os.chdir(order.folder)
    approve_files(order.approved)
    os.nice(order.niceness)
    accept_owner(order.service)
    with EventFile(order.events) as events:
        orders = Orders(source, service=service)
        console = JobConsole(events=events, orders=orders, owner=order.owner)

        def job() -> None:
            operation = order.kind.operation  # signals must not interrupt this import
            allow_signals()
            request = parse_request(
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
            ending = Ending(1, "Mistake", f"internal error: {type(error).__name__}: {error}")
            events.write(_end_event(ending))
            raise
        events.write(_end_event(ending))
    return ending.code


def _end_event(ending: Ending) -> EndEvent:
    return EndEvent(
        at_s=time.time(),
        exit_code=ending.code,
        error=ending.kind or None,
        message=make_printable(ending.message) or None,
        code=ending.refusal or None,
    )


def _warm_up() -> None:
    """Import modules, load compiled kernels and compile page templates that most jobs need."""
    for name in ("record", "identify", "check"):
        operation(name).load()
    base_parameters(RobotModel.from_description(load_cell("ir361").robot))
    load_templates()
