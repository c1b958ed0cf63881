"""Latency of STOP while a service is attacked: `python -m benchmarks.attacks`.

One `rid-daq serve` has two simulated cells, and one cell records a motion in real time. All
attacks run at the same time and on this computer:
- requests with bodies of 17 MB and without a token,
- a viewer that opens as many WebSockets as possible and sends invalid data,
- another program that locks the service's database,
- slow requests of a viewer, and a thousand slow clients,
- a busy process on every core.

STOP is pressed for the other cell, alternately over a new HTTP connection and over an open
`/api/v1/stop-line`. For comparison, a process that only echoes is measured equally often; its
latency is that of the computer itself. Then the recorded motion is stopped. Requirements: the p99
of the answers is at most 50 ms, no STOP is lost, and the cyclic task skips no cycle.

`--presses N` sets the number of presses, `--quick` reduces it to 100. The last line is one JSON
object.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import multiprocessing
import os
import random
import re
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from acquisition.journal.cycle_reader import CycleReader
from acquisition.runs.manifest import RECORDING
from acquisition.task.control_block import ControlBlock
from acquisition.task.states import TaskState
from benchmarks.attackers import ATTACKS, Target, attack
from benchmarks.live import burn
from benchmarks.service import MOTION
from benchmarks.stop_presser import (
    LOST_S,
    Pressed,
    StopLineClient,
    echo,
    press_echo,
    press_http,
    raise_priority,
)
from rid_daq.service.client import ServiceClient
from rid_daq.service.records import Job
from rid_daq.service.sockets import socket_path_of
from rid_daq.service.store.state_folder import STATE_FOLDER

STOP_BAR_MS: Final = 50.0
PATIENCE_S: Final = 120.0
PRESSES: Final = 600
QUICK: Final = 100
SETTLE_S: Final = 5.0
IDLE_CELL: Final = "my_cell"
MOVING_CELL: Final = "ir361"


@contextlib.contextmanager
def serving(folder: Path) -> Iterator[tuple[ServiceClient, int, str]]:
    """Yield a client of a service with two cells, its port and the moving cell's lease key."""
    os.environ["XDG_RUNTIME_DIR"] = str(folder)
    program = [sys.executable, "-m", "rid_daq"]
    subprocess.run([*program, "init", str(folder / "other")], check=True, capture_output=True)
    (folder / "motion.yaml").write_text(MOTION)
    words = ["serve", MOVING_CELL, str(folder / "other" / "cell.yaml"), "--folder", str(folder)]
    output = folder / "output.txt"
    with output.open("w") as stream:
        process = subprocess.Popen(
            [*program, *words, "--listen", "127.0.0.1:0", "--pace", "1"],
            stdout=stream,
            stderr=stream,
        )
    try:
        until_s = time.monotonic() + PATIENCE_S
        while not (found := re.search(r"127\.0\.0\.1:(\d+)/", output.read_text())):
            if process.poll() is not None or time.monotonic() > until_s:
                raise SystemExit(f"the service did not start: {output.read_text()}")
            time.sleep(0.05)
        with ServiceClient.at(str(socket_path_of(folder))) as client:
            path = f"/cells/{MOVING_CELL}/lease"
            key = str(client.ask("POST", path, {"seconds": 3600.0})["key"])
            client.run(MOVING_CELL, "check", {"seconds": 0.2}, lease=key).require_done()
            yield client, int(found[1]), key
    finally:
        process.terminate()
        process.wait(PATIENCE_S)


def begin_motion(client: ServiceClient, key: str) -> tuple[Job, ControlBlock]:
    """Start a recording in real time; return it as soon as the robot moves."""
    request = {"motion": "motion.yaml", "simulation": {"realtime": True, "pace": None}}
    body = {"kind": "record", "request": request, "on_lost_client": "finish"}
    job = Job.model_validate(client.ask("POST", f"/cells/{MOVING_CELL}/jobs", body, key))
    assert job.pid is not None
    until_s = time.monotonic() + PATIENCE_S
    while True:
        control = ControlBlock.of_process(job.pid)
        if control is not None and control.task.state is TaskState.MOVING:
            return job, control
        if time.monotonic() > until_s or client.job(job.id).state.is_over:
            raise SystemExit(f"the motion did not start: {client.job(job.id).reason}")
        time.sleep(0.05)


@contextlib.contextmanager
def run_attackers(target: Target) -> Iterator[None]:
    """Run every attacker, and a busy process on every core."""
    context = multiprocessing.get_context("spawn")
    processes = [context.Process(target=attack, args=(name, target)) for name in ATTACKS]
    processes += [context.Process(target=burn) for _ in range(os.cpu_count() or 1)]
    for process in processes:
        process.daemon = True
        process.start()
    try:
        time.sleep(SETTLE_S)
        yield
        if any(not process.is_alive() for process in processes):
            raise SystemExit("an attacker has ended too early: the result is invalid")
    finally:
        for process in processes:
            process.kill()
            process.join()


def skipped_cycles(folder: Path, job: Job) -> tuple[int, int]:
    """Return the number of skipped cycles of a recording, and the number of its cycles."""
    if job.run is None:
        raise SystemExit(f"no run: {job.reason}")
    with CycleReader(folder / "runs" / job.run / RECORDING) as reader:
        rows = np.concatenate(list(reader.rows()))
    return int(np.sum(np.diff(rows["cycle"].astype(np.int64)) - 1)), len(rows)


def press_all(port: int, presses: int) -> dict[str, Pressed]:
    """Press STOP `presses` times over each connection type, and measure as many echoes."""
    found = {"http": Pressed(), "line": Pressed(), "echo": Pressed()}
    with (
        StopLineClient.at(port) as line,
        socket.create_server(("127.0.0.1", 0)) as listener,
        socket.create_connection(listener.getsockname(), timeout=LOST_S) as echoing,
    ):
        echoer = multiprocessing.get_context("spawn").Process(target=echo, args=(listener,))
        echoer.start()
        echoing.settimeout(PATIENCE_S)
        press_echo(echoing, Pressed())  # wait until the process runs
        for number in range(presses):
            press_http(port, IDLE_CELL, found["http"])
            line.press(IDLE_CELL, number, found["line"])
            press_echo(echoing, found["echo"])
            time.sleep(random.uniform(0.0, 0.1))
    echoer.join(LOST_S)
    return found


def main() -> int:
    """Measure, and print the figures; the last line is one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--presses", type=int, default=PRESSES, metavar="N")
    parser.add_argument("--quick", action="store_true")
    options = parser.parse_args()
    presses = QUICK if options.quick else options.presses
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with serving(folder) as (client, port, key):
            token = {"name": "viewer", "role": "viewer", "person": True}
            viewer = str(client.ask("POST", "/tokens", token)["secret"])
            job, control = begin_motion(client, key)
            database = folder / STATE_FOLDER / "service.db"
            moved = Pressed()
            with run_attackers(Target(port, MOVING_CELL, viewer, database)):
                raise_priority()
                found = press_all(port, presses)
                began_s = time.monotonic()
                press_http(port, MOVING_CELL, Pressed())
                while control.task.stop_reason is None and time.monotonic() < began_s + LOST_S:
                    time.sleep(0.0002)
                moved.add(began_s, control.task.stop_reason is not None)
            client.follow(job)
            job = client.job(job.id)
            skipped, cycles = skipped_cycles(folder, job)
    for way, pressed in (
        *found.items(),
        ("time until the cyclic task of the moving robot reacted", moved),
    ):
        print(f"STOP, {way}: {pressed.words}")
    print(f"the motion skipped {skipped} of {cycles} cycles; end: {job.reason}")
    floor = found.pop("echo")
    p99_ms = max(pressed.quantile(0.99) for pressed in found.values())
    lost = sum(pressed.lost for pressed in (*found.values(), moved))
    holds = p99_ms <= STOP_BAR_MS and lost == 0 and skipped == 0
    result = {
        "name": "attacks",
        "value": round(p99_ms, 1),
        "unit": "ms from the press to the answer, p99 of the slower connection type",
        "n": 2 * presses,
        **{f"{way}_p99_ms": round(pressed.quantile(0.99), 1) for way, pressed in found.items()},
        "echo_p99_ms": round(floor.quantile(0.99), 1),
        "moving_ms": round(moved.quantile(1.0), 1),
        "lost": lost,
        "cycles": cycles,
        "skipped_cycles": skipped,
        "load": round(os.getloadavg()[0], 1),
        "bar": f"at most {STOP_BAR_MS:g} ms, none lost, no cycle skipped",
        "holds": holds,
    }
    print(json.dumps(result))
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
