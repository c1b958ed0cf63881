"""Lateness of cycles while twenty viewers receive a cell's values and live signals, or do not."""

from __future__ import annotations

import asyncio
import contextlib
import json
import multiprocessing
import os
import re
import time
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final

import httpx
import numpy as np
from numpy.typing import NDArray
from websockets.asyncio.client import ClientConnection, unix_connect

from acquisition.journal.cycle_reader import CycleReader
from acquisition.runs.manifest import RECORDING
from acquisition.task.control_block import ControlBlock
from benchmarks.lateness import calm_p99
from rid_daq.service.client import ServiceClient
from rid_daq.service.records import Job
from rid_daq.service.sockets import socket_path_of

CELL: Final = "ir361"
VIEWERS: Final = 20
SEGMENT_S: Final = 2.0
SETTLE_S: Final = 0.5
LATENESS_BAR: Final = 1.1


@dataclass(frozen=True)
class Segment:
    """Cycles of a motion, with viewers or without.

    Attributes:
        first, last: First and last cycle.
        viewers: Number of viewers that the service reports.
        messages: Total number of messages that the viewers received.
    """

    first: int
    last: int
    viewers: int
    messages: int


@dataclass(frozen=True)
class Lateness:
    """Lateness of cycles without viewers and with them, p99 [us].

    Attributes:
        without_us, with_us: p99 of calm windows, by `calm_p99`.
        all_without_us, all_with_us: p99 of all cycles.
        cycles: Number of cycles without viewers or with viewers, whichever is smaller.
    """

    without_us: float
    with_us: float
    all_without_us: float
    all_with_us: float
    cycles: int

    @property
    def ratio(self) -> float:
        """Lateness with viewers over that without."""
        return self.with_us / self.without_us

    @property
    def sentence(self) -> str:
        """Sentence with the figures."""
        return (
            f"lateness p99 with {VIEWERS} viewers {self.with_us:.0f} us, without"
            f" {self.without_us:.0f} us: {self.ratio:.2f} times (calm windows; of all"
            f" {self.all_with_us:.0f} and {self.all_without_us:.0f} us; {self.cycles} cycles each)"
        )

    def document(self) -> dict[str, float]:
        """Return the figures for the JSON line."""
        return {
            "lateness_ratio": round(self.ratio, 3),
            "lateness_with_us": round(self.with_us, 1),
            "lateness_without_us": round(self.without_us, 1),
            "lateness_all_ratio": round(self.all_with_us / self.all_without_us, 3),
            "lateness_cycles": self.cycles,
        }


def run_viewers(path: str, secrets: Sequence[str], line: Connection) -> None:
    """Connect and disconnect viewers on command, and count messages; main function of a process.

    Args:
        path: Socket of the service.
        secrets: Token of each viewer; one token may have only a few connections.
        line: Commands.
    """
    # these viewers represent other computers, which use no processor time of this computer
    os.nice(10)
    asyncio.run(_look_on(path, secrets, line))


async def _look_on(path: str, secrets: Sequence[str], line: Connection) -> None:
    loop = asyncio.get_running_loop()
    while await loop.run_in_executor(None, line.recv):
        seen = [0]
        async with contextlib.AsyncExitStack() as stack:
            for secret in secrets:
                viewer = unix_connect(
                    path,
                    "ws://localhost/api/v1/ws",
                    additional_headers={"authorization": f"Bearer {secret}"},
                )
                socket = await stack.enter_async_context(viewer)
                await socket.send(json.dumps({"signals": CELL}))
                task = asyncio.create_task(_read(socket, seen))
                stack.callback(task.cancel)
            line.send(None)
            await loop.run_in_executor(None, line.recv)
        line.send(seen[0])


async def _read(socket: ClientConnection, seen: list[int]) -> None:
    async for message in socket:
        seen[0] += isinstance(message, bytes) or json.loads(message)["type"] == "samples"


def watch(folder: Path, control: ControlBlock, seconds: float) -> Sequence[Segment]:
    """Connect and disconnect viewers for a time; return the segments with and without them."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    path = str(socket_path_of(folder))
    process = context.Process(
        target=run_viewers, args=(path, _viewer_tokens(path), theirs), daemon=True
    )
    process.start()
    segments = []
    try:
        for number in range(2 * round(seconds / (2 * (SEGMENT_S + SETTLE_S)))):
            on = number % 2 == 1
            if on:
                ours.send(True)
                ours.recv()
            time.sleep(SETTLE_S)
            viewers = _viewers(folder)
            first = control.task.cycles
            time.sleep(SEGMENT_S)
            last = control.task.cycles
            messages = 0
            if on:
                ours.send(True)
                messages = ours.recv()
            segments.append(Segment(first, last, viewers, messages))
        ours.send(False)
        process.join(10.0)
    finally:
        process.kill()
        process.join()
    return segments


def _viewer_tokens(path: str) -> list[str]:
    """Make the token of each viewer at the service, and return the secrets."""
    with ServiceClient.at(path) as client:
        made = [
            client.ask("POST", "/tokens", {"name": f"viewer {number}", "role": "viewer"})
            for number in range(VIEWERS)
        ]
    return [str(each["secret"]) for each in made]


def _viewers(folder: Path) -> int:
    """Return the number of viewers that the service reports."""
    transport = httpx.HTTPTransport(uds=str(socket_path_of(folder)))
    with httpx.Client(transport=transport, base_url="http://localhost") as http:
        found = re.search(r"^rid_daq_viewers (\d+)", http.get("/metrics").text, re.MULTILINE)
    if found is None:
        raise SystemExit("the service does not report the number of viewers")
    return int(found[1])


def lateness(folder: Path, job: Job, segments: Sequence[Segment]) -> Lateness:
    """Return the lateness of a recording's cycles with and without viewers.

    Raises:
        SystemExit: The number of viewers was wrong, viewers received nothing, or the motion ended
            early, for example because the computer was too busy for it.
    """
    if job.run is None:
        raise SystemExit(f"no run: {job.reason}")
    with CycleReader(folder / "runs" / job.run / RECORDING) as reader:
        rows = np.concatenate(list(reader.rows()))
    parts: dict[bool, list[NDArray[np.float64]]] = {True: [], False: []}
    for number, each in enumerate(segments):
        on = number % 2 == 1
        if each.viewers != (VIEWERS if on else 0) or (on and each.messages < VIEWERS):
            raise SystemExit(f"{each.viewers} viewers, which received {each.messages} messages")
        inside = (rows["cycle"] >= each.first) & (rows["cycle"] < each.last)
        parts[on].append(rows["lateness_s"][inside])
    without, having = (1e6 * np.concatenate(parts[on]) for on in (False, True))
    window = min(len(each) for each in (*parts[True], *parts[False]))
    if window == 0:
        raise SystemExit(f"the motion ended before the measurement: {job.state.value} {job.reason}")
    return Lateness(
        calm_p99(without, window),
        calm_p99(having, window),
        float(np.quantile(without, 0.99)),
        float(np.quantile(having, 0.99)),
        min(len(without), len(having)),
    )
