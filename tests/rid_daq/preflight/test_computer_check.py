"""Preflight lines about this computer."""

import multiprocessing
import shutil
import time
from pathlib import Path

import pytest

from acquisition.journal.disk_reserve import FREE_BYTES
from rid_daq.preflight.computer_check import (
    SLOWEST_BYTES_S,
    WRITE_BYTES,
    disk_lines,
    time_lines,
    try_awake,
)
from rid_daq.preflight.lateness import sleep_like_the_task


def test_the_latency_request_for_processors_is_tested_and_released(tmp_path: Path) -> None:
    latency = tmp_path / "cpu_dma_latency"
    assert try_awake(latency) == f"this system has no {latency}"
    latency.touch()
    assert try_awake(latency) == "allowed"
    assert latency.read_bytes() == b""


def test_a_refused_latency_request_has_advice(tmp_path: Path) -> None:
    message = (
        f"refused: cycles begin later ({tmp_path}: Is a directory); give this user write permission"
    )
    assert try_awake(tmp_path) == message


def test_the_lateness_of_cycles_is_measured_like_in_the_cyclic_task() -> None:
    found = {line.what: line.found for line in time_lines()}
    source, late = found["clock source; lateness of a cycle, median and largest"].split("; ")
    median, worst = (float(each.removesuffix(" ms")) for each in late.split(", "))
    assert source
    assert 0.0 <= median <= worst + 0.005


def test_a_disk_without_room_is_red(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for free, verdict in ((FREE_BYTES, "ok"), (FREE_BYTES - 1, "red")):
        usage = shutil.disk_usage(tmp_path)._replace(free=free)
        monkeypatch.setattr("shutil.disk_usage", lambda _, usage=usage: usage)
        (line,) = [each for each in disk_lines(tmp_path) if each.what == "free disk"]
        assert line.verdict == verdict


@pytest.mark.parametrize("taken_s", [5.01, 1.01 * WRITE_BYTES / SLOWEST_BYTES_S])
def test_a_disk_that_is_too_slow_is_red(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, taken_s: float
) -> None:
    monkeypatch.setattr("rid_daq.preflight.computer_check.write_seconds", lambda *_: taken_s)
    (line,) = [each for each in disk_lines(tmp_path) if each.what == "writing to disk"]
    assert line.verdict == "red"


def test_a_date_in_the_past_is_red(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rid_daq.preflight.computer_check.measure_lateness", lambda: "not measured")
    before = time.struct_time((2024, 12, 31, 23, 59, 59, 1, 366, 0))
    monkeypatch.setattr("time.gmtime", lambda *_: before)
    (line,) = [each for each in time_lines() if each.what == "date"]
    assert line.verdict == "red"


def test_an_unwritable_folder_is_not_reported_as_a_slow_disk() -> None:
    (line,) = [each for each in disk_lines(Path("/proc/runs")) if each.what == "writing to disk"]
    assert (line.verdict, line.found.split(":")[0]) == ("red", "/proc")
    assert line.next_action.startswith("choose another folder with --runs")


def test_a_measuring_process_without_its_program_ends_without_error() -> None:
    """Ctrl-C ends the program while its measuring process still sleeps."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    ours.close()
    process = context.Process(target=sleep_like_the_task, args=(theirs,))
    process.start()
    theirs.close()
    process.join()
    assert process.exitcode == 0
