"""Requests of the cyclic task's process to the operating system."""

import multiprocessing
import os
import struct
from multiprocessing.connection import Connection
from pathlib import Path

from acquisition.task.realtime import PROCESSOR_LATENCY, keep_processors_awake, request_realtime


def test_the_kernel_is_asked_for_processors_that_wake_up_within_no_time(tmp_path: Path) -> None:
    latency = tmp_path / "cpu_dma_latency"
    latency.touch()
    assert keep_processors_awake(latency) is None
    assert struct.unpack("=i", latency.read_bytes()) == (0,)


def test_a_kernel_without_the_wish_is_not_worth_a_word(tmp_path: Path) -> None:
    assert keep_processors_awake(tmp_path / "cpu_dma_latency") is None


def test_a_refusal_says_what_it_means_and_what_to_do(tmp_path: Path) -> None:
    told = keep_processors_awake(tmp_path)
    assert told == (
        f"processors may enter deep idle states between cycles ({tmp_path}: Is a directory);"
        " give this user write access to the file"
    )


def report_refusals_and_wait(pipe: Connection) -> None:
    """Send what was refused, then wait for a message."""
    pipe.send(request_realtime())
    pipe.recv()


def test_the_wish_holds_while_the_task_lives_or_its_refusal_is_told() -> None:
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
