"""What `kill -9` of the service leaves: `python -m benchmarks.service_kills --kills N`.

The simulated drives are another program's (`rid-daq mock`) and outlive everything. A service is
asked for a recording and killed at a random moment: before, within or after it. Then its worker
must end by itself, no drive may be enabled, and the next service must know every job that was
accepted, none of them twice, none of them running. At last 10,000 requests are made of a service
whose memory must stay as it was. The last line is one JSON object.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import can

from acquisition.runs.catalogue import list_runs
from benchmarks.service import MOTION, PATIENCE_S
from config.errors import RidDaqError
from config.load import load_cell
from rid_daq.service.client import ServiceClient
from rid_daq.service.records import Job
from rid_daq.service.sockets import socket_of

LONGEST_S: Final = 12.0
REQUESTS: Final = 10_000
MEMORY_BAR: Final = 1.05
ENABLED: Final = 0x27
STATE: Final = 0x6F


@contextlib.contextmanager
def program(*words: str, folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Yield a program of rid-daq that runs; end it."""
    with (folder / "said").open("ab") as said:
        process = subprocess.Popen(
            [sys.executable, "-m", "rid_daq", *words], stdout=said, stderr=said
        )
    try:
        yield process
    finally:
        if process.poll() is None:
            process.terminate()
            process.wait(PATIENCE_S)


@contextlib.contextmanager
def service(folder: Path) -> Iterator[tuple[subprocess.Popen[bytes], ServiceClient]]:
    """Yield a service of the cell, and a client of it."""
    words = ("serve", "ir361", "--folder", str(folder), "--listen", "127.0.0.1:0")
    with program(*words, folder=folder) as process:
        until_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < until_s and process.poll() is None:
            with contextlib.suppress(RidDaqError), ServiceClient.at(str(socket_of(folder))) as one:
                one.cells()
                break
            time.sleep(0.05)
        with ServiceClient.at(str(socket_of(folder))) as client:
            yield process, client


def enabled_drives() -> int:
    """Return how many of the cell's drives are switched on, by their statuswords (6041h)."""
    cell = load_cell("ir361").config
    count = 0
    with can.Bus(interface=cell.can.interface, channel=cell.can.channel) as bus:
        for axis in cell.axes:
            read = bytes((0x40, 0x41, 0x60, 0, 0, 0, 0, 0))
            bus.send(
                can.Message(arbitration_id=0x600 + axis.node_id, data=read, is_extended_id=False)
            )
            until_s = time.monotonic() + 2.0
            while time.monotonic() < until_s:
                answer = bus.recv(0.1)
                if answer is not None and answer.arbitration_id == 0x580 + axis.node_id:
                    count += answer.data[4] & STATE == ENABLED
                    break
            else:
                raise SystemExit(f"node {axis.node_id} does not answer: nobody knows its state")
    return count


def begun(client: ServiceClient, seconds_left: float) -> Job | None:
    """Ask for a recording as a program does; return the job that was accepted."""
    try:
        key = client.ask("POST", "/cells/ir361/lease", {"seconds": 60.0})["key"]
        if client.cell("ir361").state != "ready":
            client.run("ir361", "check", {"seconds": 0.2}, lease=key)
        wanted = {"kind": "record", "request": {"motion": "motion.yaml"}}
        return Job.model_validate(client.ask("POST", "/cells/ir361/jobs", wanted, key))
    except RidDaqError:
        return None
    finally:
        time.sleep(random.uniform(0.0, seconds_left))


def memory_bytes(pid: int) -> int:
    """Return how much memory a process has."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def main() -> int:
    """Kill, look, and print; the last line is one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=20, metavar="N")
    kills: int = parser.parse_args().kills
    accepted: list[Job] = []
    enabled = still = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["XDG_RUNTIME_DIR"] = name
        (folder / "motion.yaml").write_text(MOTION)
        with program("mock", "ir361", folder=folder):
            time.sleep(5.0)
            for number in range(kills):
                with service(folder) as (process, client):
                    job = begun(client, LONGEST_S)
                    process.send_signal(signal.SIGKILL)
                    process.wait()
                accepted += [] if job is None else [job]
                if job is not None and job.pid is not None:
                    until_s = time.monotonic() + 30.0
                    while Path(f"/proc/{job.pid}").exists() and time.monotonic() < until_s:
                        time.sleep(0.02)
                    still += Path(f"/proc/{job.pid}").exists()
                enabled += enabled_drives()
                print(f"kill {number + 1} of {kills}", flush=True)
            with service(folder) as (process, client):
                known = {one["id"]: one for one in client.ask("GET", "/jobs?limit=1000")}
                before = 0
                for number in range(REQUESTS):
                    client.cell("ir361")
                    if number == REQUESTS // 10:
                        before = memory_bytes(process.pid)
                grown = memory_bytes(process.pid) / before
        lost = [job.id for job in accepted if job.id not in known]
        unfinished = [one for one in known.values() if one["state"] in ("accepted", "running")]
        runs = [folder.run_id for folder, _ in list_runs(folder / "runs")]
        again = len(runs) - len({one["run"] for one in known.values() if one["run"]})
    holds = not (lost or unfinished or enabled or still or again > 0) and grown <= MEMORY_BAR
    print(
        f"{kills} kills, {len(accepted)} recordings accepted: {len(lost)} lost, {max(again, 0)} run"
        f" again, {len(unfinished)} left running, {still} workers left, {enabled} drives enabled;"
        f" memory over {REQUESTS} requests: {grown:.3f} times"
    )
    result = {
        "name": "service_kills",
        "kills": kills,
        "accepted": len(accepted),
        "lost": len(lost),
        "run_again": again,
        "left_running": len(unfinished),
        "workers_left": still,
        "drives_enabled": enabled,
        "memory_ratio": round(grown, 3),
        "bar": f"0 lost, 0 run again, 0 enabled; memory at most {MEMORY_BAR:g} times",
        "holds": holds,
    }
    print(json.dumps(result))
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
