"""Services for tests: in this process without workers, or as a process with a simulated cell."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import pytest

from acquisition.task.service_beat import ServiceBeat
from config.load import load_cell, to_yaml
from identification.design.two_harmonic import TwoHarmonicOptions, design_two_harmonic
from rid_daq.service.client import ServiceClient
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.records import Job, JobState
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.service import CellService
from rid_daq.service.sockets import socket_path_of
from rid_daq.service.workers.worker_process import WorkerProcess
from rid_daq.service.workers.worker_template import WorkerTemplate

PATIENCE_S = 180.0


@pytest.fixture(scope="session")
def motion() -> str:
    """Return a short periodic motion of the bundled cell: three periods of 4.8 s."""
    return periodic(3)


@pytest.fixture(scope="session")
def long_motion() -> str:
    """Return a motion of two minutes, which a test stops long before its end.

    Its periods are short, so that its main part begins soon.
    """
    return periodic(100, period_s=1.2)


def periodic(periods: int, period_s: float = 4.8) -> str:
    cell = load_cell("ir361")
    options = TwoHarmonicOptions(
        period_s, highest_harmonic=4, limit_fraction=0.35, tries=8, seed=3, periods=periods
    )
    return to_yaml(design_two_harmonic(cell.robot, options, cell.config.cycle_time_s))


@pytest.fixture
def service(tmp_path: Path) -> CellService:
    """Return a service of one simulated cell in this process."""
    return CellService(tmp_path, [ServedCell("ir361", 20.0)])


def job(kind: str = "payload_session") -> Job:
    return Job(
        id=f"job-{kind}",
        cell="ir361",
        kind=JobKind(kind),
        state=JobState.ACCEPTED,
        owner="anna",
        request={},
        on_lost_client="finish",
        created_s=0.0,
    )


class ClosedInput:
    """Standard input of a worker that no longer reads from it."""

    def is_closing(self) -> bool:
        return True


class Worker:
    """A worker whose process is the test's process; the test simulates its motions."""

    pid = os.getpid()
    returncode: int | None = None
    stdin = ClosedInput()
    terminated = 0

    def __init__(self) -> None:
        self.beat = ServiceBeat.create()

    def terminate(self) -> None:
        self.terminated += 1

    def kill(self) -> None:
        self.returncode = -9

    async def wait(self) -> int | None:
        return self.returncode


def as_worker(process: Worker) -> WorkerProcess:
    return cast(WorkerProcess, process)


@pytest.fixture
def worker(monkeypatch: pytest.MonkeyPatch) -> Worker:
    """Return the simulated worker that the service receives when it starts a worker."""
    worker = Worker()

    async def start_worker(_template: WorkerTemplate) -> WorkerProcess:
        await asyncio.sleep(0)
        return as_worker(worker)

    async def prepare(_template: WorkerTemplate) -> None:
        pass

    monkeypatch.setattr(WorkerTemplate, "start_worker", start_worker)
    monkeypatch.setattr(WorkerTemplate, "prepare", prepare)
    return worker


def has_handler(pid: int, number: signal.Signals) -> bool:
    """Return True if a process has a handler for a signal."""
    status = Path(f"/proc/{pid}/status").read_text()
    mask = int(status.partition("SigCgt:")[2].split(maxsplit=1)[0], 16)
    return bool(mask >> (number - 1) & 1)


@dataclass
class ServedProcess:
    """`rid-daq serve` as a process.

    Attributes:
        process: The process.
        url: Address of its pages, with the secret shown in its terminal.
    """

    folder: Path
    process: subprocess.Popen[str]
    url: str

    @property
    def client(self) -> ServiceClient:
        return ServiceClient.at(str(socket_path_of(self.folder)))

    def end(self, number: signal.Signals = signal.SIGTERM) -> int:
        self.process.send_signal(number)
        return self.process.wait(PATIENCE_S)

    def leave_nothing(self) -> None:
        """End the process after any outcome of a test, so that it does not disturb other tests."""
        if self.process.poll() is None:
            try:
                self.end()
            finally:
                self.process.kill()


@contextlib.contextmanager
def serving(folder: Path, *more: str, cell: str = "ir361") -> Iterator[ServedProcess]:
    """Run a service of a cell while the `with` block is active."""
    running = serve(folder, *more, cell=cell)
    try:
        yield running
    finally:
        running.leave_nothing()


def serve(folder: Path, *more: str, cell: str = "ir361") -> ServedProcess:
    """Start a service of a cell in a folder, and wait until it answers."""
    with (folder / "serve.log").open("ab") as log:
        process = subprocess.Popen(
            [
                *(sys.executable, "-m", "rid_daq", "serve", cell, "--folder", str(folder)),
                *("--listen", "127.0.0.1:0", "--pace", "20", "--json", *more),
            ],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=log,
            text=True,
            env={**os.environ},
        )
    assert process.stdout is not None
    text = ""
    with process.stdout as output:
        while not text.endswith("\n}\n"):
            line = output.readline()
            assert line, text + (folder / "serve.log").read_text()
            text += line
    document = json.loads(text)
    assert "url" in document, text
    return ServedProcess(folder, process, str(document["url"]))


@pytest.fixture
def served(tmp_path: Path) -> Iterator[ServedProcess]:
    """Run a service of a bundled simulated cell as a separate process for one test."""
    with serving(tmp_path) as running:
        yield running


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServedProcess]:
    """Run one service of a bundled simulated cell for all tests of a file that do not change it."""
    with serving(tmp_path_factory.mktemp("served")) as running:
        yield running
        assert running.end() == 0
