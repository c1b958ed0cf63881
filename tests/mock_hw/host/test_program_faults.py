"""Faults of a program's processes, applied to real processes of the test."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import pytest

from config.errors import ConfigError
from config.process.own_process import ProcessName
from config.simulation.faults import FaultScript
from mock_hw.host.full_disk import FullDisk
from mock_hw.host.program_faults import ProgramFaults
from tests.builders.raised_codes import raises_code

PATIENCE_S = 120.0
CHILD = """
import sys
file = open(sys.argv[2], "xb", buffering=0) if len(sys.argv) > 2 else None
if file:
    file.write(b"header")
open("/proc/self/comm", "w").write(sys.argv[1])
print("here", flush=True)
for line in sys.stdin:
    try:
        print(file.write(b"x" * int(line)), flush=True)
    except OSError as error:
        print(error.strerror, flush=True)
"""


class Child:
    """A process with a given name that writes to a file on command."""

    def __init__(self, name: ProcessName, *files: Path) -> None:
        words = [sys.executable, "-S", "-c", CHILD, name, *map(str, files)]
        self.process = subprocess.Popen(
            words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        assert self._line() == "here"

    def write(self, count: int) -> str:
        assert self.process.stdin is not None
        self.process.stdin.write(f"{count}\n")
        self.process.stdin.flush()
        return self._line()

    def wait_for(self, change: int) -> None:
        """Wait until the process was stopped (WSTOPPED) or continued (WCONTINUED)."""
        assert os.waitid(os.P_PID, self.process.pid, change) is not None

    def end(self) -> int:
        self.process.kill()
        self.process.communicate()
        return self.process.returncode

    def _line(self) -> str:
        assert self.process.stdout is not None
        return self.process.stdout.readline().strip()


@pytest.fixture
def start() -> Iterator[Callable[..., Child]]:
    children: list[Child] = []

    def begin(name: ProcessName, *files: Path) -> Child:
        children.append(Child(name, *files))
        return children[-1]

    yield begin
    for child in children:
        child.end()


class Faults:
    """Faults of a program's processes, which the test triggers instead of the simulated drives."""

    def __init__(self, *faults: dict[str, Any]) -> None:
        self.drives: Connection
        self.drives, self._theirs = Pipe()
        script = FaultScript.model_validate({"program": faults})
        self._faults = ProgramFaults(script.program, self._theirs)

    def __enter__(self) -> Faults:
        self._faults.__enter__()
        return self

    def __exit__(self, kind: Any, error: Any, traceback: Any) -> None:
        try:
            self._faults.__exit__(kind, error, traceback)
        finally:
            self.drives.close()
            self._theirs.close()

    def begin(self, number: int = 0) -> None:
        self.drives.send(number)
        assert self.drives.poll(PATIENCE_S)
        self.drives.recv()


def test_only_the_named_process_is_killed(start: Callable[..., Child]) -> None:
    recorder, task = start(ProcessName.RECORDER), start(ProcessName.TASK)
    with Faults({"kind": "kill", "process": "task"}) as faults:
        faults.begin()
        assert task.process.wait(PATIENCE_S) == -signal.SIGKILL
    assert recorder.process.poll() is None


def test_a_frozen_process_continues_by_itself(start: Callable[..., Child]) -> None:
    task = start(ProcessName.TASK)
    with Faults({"kind": "freeze", "process": "task", "duration_s": 0.05}) as faults:
        begun_s = time.monotonic()
        faults.begin()
        task.wait_for(os.WSTOPPED)
        task.wait_for(os.WCONTINUED)
        assert time.monotonic() - begun_s >= 0.05


def test_at_the_end_no_process_is_frozen_and_no_file_or_thread_is_left(
    start: Callable[..., Child], tmp_path: Path
) -> None:
    recorder = start(ProcessName.RECORDER, tmp_path / "recording.mcap")
    before = set(os.listdir("/proc/self/fd"))
    stall = {"kind": "disk_stall", "duration_s": 1000.0}
    with Faults(stall, {"kind": "freeze", "process": "task", "duration_s": 1.0}) as faults:
        faults.begin(0)
        recorder.wait_for(os.WSTOPPED)
        faults.begin(1)  # the fault waits for the start of the cyclic task
    recorder.wait_for(os.WCONTINUED)
    assert recorder.write(3) == "3"
    assert set(os.listdir("/proc/self/fd")) == before
    assert "program faults" not in {thread.name for thread in threading.enumerate()}


def test_the_fault_waits_for_a_process_that_has_not_started(start: Callable[..., Child]) -> None:
    with Faults({"kind": "kill", "process": "recorder"}) as faults:
        faults.begin()
        recorder = start(ProcessName.RECORDER)
        assert recorder.process.wait(PATIENCE_S) == -signal.SIGKILL


@pytest.mark.parametrize("name", ["INT", "TERM", "HUP"])
def test_a_signal_is_delivered_to_the_programs_main_thread(name: str) -> None:
    came = threading.Event()
    number = signal.Signals[f"SIG{name}"]
    signal.signal(number, lambda _number, _frame: came.set())
    with Faults({"kind": "signal", "signal": name}) as faults:
        faults.begin()
        assert came.wait(PATIENCE_S)


def test_a_file_with_a_size_limit_fails_in_the_middle_of_a_write(
    start: Callable[..., Child], tmp_path: Path
) -> None:
    recorder = start(ProcessName.RECORDER, tmp_path / "recording.mcap")
    assert recorder.write(100) == "100"
    with Faults({"kind": "disk_error", "after_bytes": 50}) as faults:
        faults.begin()
        assert recorder.write(30) == "30"
        assert recorder.write(30) == "20", "only bytes that fit on the disk are written"
        assert recorder.write(30) == "File too large"
    assert (tmp_path / "recording.mcap").stat().st_size == 156


def test_the_fault_waits_for_a_recording_that_has_not_started(
    start: Callable[..., Child], tmp_path: Path
) -> None:
    start(ProcessName.RECORDER)
    with Faults({"kind": "disk_error"}) as faults:
        faults.begin()
        recorder = start(ProcessName.RECORDER, tmp_path / "recording.mcap")
        while recorder.write(1) == "1":
            os.sched_yield()


def test_a_refusal_of_the_system_is_reported_at_the_end(
    start: Callable[..., Child], monkeypatch: pytest.MonkeyPatch
) -> None:
    start(ProcessName.TASK)

    def refused(_pid: int) -> int:
        raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))

    monkeypatch.setattr("mock_hw.host.program_faults.os.pidfd_open", refused)
    frozen = {"kind": "freeze", "process": "task", "duration_s": 1.0}
    with raises_code(ConfigError, "RID-FAULT-SCRIPT", "freeze:"), Faults(frozen) as faults:
        faults.begin()


def test_a_disk_used_by_other_programs_is_never_filled(
    start: Callable[..., Child], tmp_path: Path
) -> None:
    start(ProcessName.RECORDER, tmp_path / "recording.mcap")
    with (
        raises_code(ConfigError, "RID-FAULT-SCRIPT"),
        Faults({"kind": "disk_full"}) as faults,
    ):
        faults.begin()
    with raises_code(ConfigError, "RID-FAULT-SCRIPT"):
        FullDisk(tmp_path / "not" / "there")
