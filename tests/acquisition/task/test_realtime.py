"""Requests of the cyclic task's process to the operating system for low latency."""

import multiprocessing
import os
import struct
from multiprocessing.connection import Connection
from pathlib import Path

from acquisition.task.realtime import PROCESSOR_LATENCY, keep_processors_awake, request_realtime


def test_the_kernel_receives_a_wake_up_latency_of_zero(tmp_path: Path) -> None:
    latency = tmp_path / "cpu_dma_latency"
    latency.touch()
    assert keep_processors_awake(latency) is None
    assert struct.unpack("=i", latency.read_bytes()) == (0,)


def test_a_kernel_without_this_request_is_not_reported(tmp_path: Path) -> None:
    assert keep_processors_awake(tmp_path / "cpu_dma_latency") is None


def test_a_refusal_is_reported_with_its_effect_and_remedy(tmp_path: Path) -> None:
    finding = keep_processors_awake(tmp_path)
    assert finding == (
        f"processors may enter deep idle states between cycles ({tmp_path}: Is a directory);"
        " give this user write access to the file"
    )


def report_refusals_and_wait(pipe: Connection) -> None:
    """Request real-time scheduling, send the list of refused requests, then wait for a message."""
    pipe.send(request_realtime())
    pipe.recv()


def test_the_request_lasts_as_long_as_the_task_and_a_refusal_is_reported() -> None:
    context = multiprocessing.get_context("spawn")
    pipe, theirs = context.Pipe()
    task = context.Process(target=report_refusals_and_wait, args=(theirs,))
    task.start()
    theirs.close()
    refused = pipe.recv()
    held = {os.readlink(link) for link in Path(f"/proc/{task.pid}/fd").iterdir()}
    pipe.send(None)
    task.join()
    refusals = [sentence for sentence in refused if str(PROCESSOR_LATENCY) in sentence]
    expected = PROCESSOR_LATENCY.exists() and not refusals
    assert (str(PROCESSOR_LATENCY) in held) == expected
