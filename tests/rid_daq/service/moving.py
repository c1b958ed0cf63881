"""Shared steps of tests with a served cell: lease the cell, start a motion."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx

from acquisition.motion.samples import Phase
from acquisition.task.control_block import ControlBlock
from config.errors import ConfigError, LockedError, ServiceError
from rid_daq.service.client import ServiceClient
from rid_daq.service.records import CellState, Job
from tests.rid_daq.service.conftest import PATIENCE_S, ServedProcess

CHECK = {"seconds": 0.2}


def until(
    condition: Callable[[], bool], patience_s: float = PATIENCE_S, period_s: float = 0.05
) -> None:
    """Wait until a condition is true; check it every `period_s`, and fail after a timeout."""
    end_s = time.monotonic() + patience_s
    while not condition():
        assert time.monotonic() < end_s, "the condition was not met in time"
        time.sleep(period_s)


def begin_motion(served: ServedProcess, lease: str, pace: float = 1.0, **options: object) -> Job:
    """Start a recording, and return when the robot moves."""
    with served.client as client:
        request = {"motion": "motion.yaml", "simulation": {"pace": pace}}
        body = {"kind": "record", "request": request, **options}
        job = Job.model_validate(client.ask("POST", "/cells/ir361/jobs", body, lease))
        pid = client.job(job.id).pid
        assert pid is not None
        until(lambda: is_in_motion(pid) or client.job(job.id).state.is_over)
        assert is_in_motion(pid), client.job(job.id)
        return job


def is_in_motion(pid: int) -> bool:
    """Return True from the end of the approach until the robot holds its last position."""
    control = ControlBlock.of_process(pid)
    return control is not None and Phase.RUN_IN <= control.progress.phase < Phase.HOLD


def events(client: ServiceClient, job: Job) -> list[dict[str, object]]:
    found: list[dict[str, object]] = client.ask("GET", f"/jobs/{job.id}/events")
    return found


@contextlib.contextmanager
def leased_cell(served: ServedProcess, motion: str) -> Iterator[str]:
    """Lease a cell, make it ready to move, and yield the key of the lease.

    At the end, the cell is stopped and the lease is returned.
    """
    (served.folder / "motion.yaml").write_text(motion, encoding="utf-8")
    with served.client as client:
        key = str(client.ask("POST", "/cells/ir361/lease", {"seconds": 600.0})["key"])
        if client.cell("ir361").state is not CellState.READY:
            client.run("ir361", "check", CHECK, lease=key).require_done()
    try:
        yield key
    finally:
        with contextlib.suppress(ConfigError, LockedError, ServiceError), served.client as client:
            client.stop("ir361")
            until(lambda: client.cell("ir361").job is None)
            client.ask("DELETE", "/cells/ir361/lease", None, key)


def served_port(served: ServedProcess) -> int:
    return int(httpx.URL(served.url).port or 0)


def front_process(served: ServedProcess) -> int | None:
    """Return the process id of the front process of a service, or None."""
    task = Path(f"/proc/{served.process.pid}/task/{served.process.pid}/children")
    for child in map(int, task.read_text().split()):
        words = Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0")
        if b"rid_daq.service.front" in words:
            return child
    return None
