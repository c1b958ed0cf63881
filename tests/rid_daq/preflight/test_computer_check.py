"""What the preflight says of this computer."""

import multiprocessing
from pathlib import Path

from rid_daq.preflight.computer_check import disk_lines, time_lines, try_awake
from rid_daq.preflight.lateness import sleep_like_the_task


def test_keeping_processors_awake_is_tried_and_given_back(tmp_path: Path) -> None:
    latency = tmp_path / "cpu_dma_latency"
    assert try_awake(latency) == f"this system has no {latency}"
    latency.touch()
    assert try_awake(latency) == "allowed"
    assert latency.read_bytes() == b""


def test_a_refusal_says_what_to_do(tmp_path: Path) -> None:
    told = f"refused: cycles begin later ({tmp_path}: Is a directory); let this user write to it"
    assert try_awake(tmp_path) == told


def test_how_late_cycles_begin_is_measured_as_the_task_would_begin_them() -> None:
    found = {line.what: line.found for line in time_lines()}
    source, late = found["clock source; a cycle begins late by, median and worst"].split("; ")
    median, worst = (float(each.removesuffix(" ms")) for each in late.split(", "))
    assert source
    assert 0.0 <= median <= worst + 0.005


def test_a_folder_that_cannot_be_written_to_is_no_slow_disk() -> None:
    (line,) = [each for each in disk_lines(Path("/proc/runs")) if each.what == "writing to disk"]
    assert (line.verdict, line.found.split(":")[0]) == ("red", "/proc")
    assert line.next_action.startswith("choose another folder with --runs")


def test_nobody_who_waits_for_the_measurement_any_more_is_no_error() -> None:
    """Ctrl-C ends the program while its process still sleeps."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    ours.close()
    process = context.Process(target=sleep_like_the_task, args=(theirs,))
    process.start()
    theirs.close()
    process.join()
    assert process.exitcode == 0
