"""What `kill -9` of the service leaves: `python -m benchmarks.service_kills --kills N`.

The simulated drives are another program's (`rid-daq mock`) and outlive everything. One service
after the other is killed at a random moment: while it starts, while it journals a job that it was
just asked for, while the job prepares, moves, and writes what it measured. The next one is started
at once, as systemd does. Before it is asked for anything the worker of the one before must have
ended by itself, and no drive may be enabled. `--lanes` such rows go on beside each other, each with
a cell and a folder of its own; after `--minutes` no more are killed, and it says how many were.

At the end the service must know every job that was accepted, none of them running, none of them
done twice. The computer may be busy meanwhile. The last line is one JSON object.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

import can

from acquisition.motion.samples import Phase
from acquisition.runs.catalogue import list_runs
from acquisition.task.control_block import ControlBlock
from acquisition.task.states import TaskState
from config.errors import RidDaqError
from config.load import load_cell
from rid_daq.service.client import ServiceClient
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.records import CellState, Job
from rid_daq.service.running_job import EventTail
from rid_daq.service.sockets import socket_path_of
from rid_daq.service.store.database import open_database
from rid_daq.service.store.jobs import JobStore
from rid_daq.service.store.state_folder import STATE_FOLDER

PATIENCE_S: Final = 300.0
CELL: Final = "ir361"
ENABLED: Final = 0x27
STATE: Final = 0x6F
LEASE_S: Final = 3600.0
REST_S: Final = 180.0
STARTING: Final = 0.15
"""The share of kills that fall on a service's start."""

ASKING: Final = 0.25
"""The share of the others that fall within `ASKING_S` of the request."""

ASKING_S: Final = 0.1
MOTION: Final = """kind: fourier
robot: ir361
period_s: 0.8
periods: 2
ramp_s: 0.4
joints:
  - {joint: axis1, sine: [0.05], cosine: [0.02]}
  - {joint: axis2, sine: [0.05], cosine: [0.02]}
  - {joint: axis3, sine: [0.05], cosine: [0.02]}
"""


@dataclass
class Tally:
    """What the kills have left, so far.

    Attributes:
        fell: How many kills fell on what.
        accepted: The jobs that the service has said it accepted.
        enabled, still: Drives that were enabled, and workers that were there, when neither may be.
    """

    fell: Counter[str] = field(default_factory=Counter)
    accepted: list[str] = field(default_factory=list)
    enabled: int = 0
    still: int = 0


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


def until(condition: Callable[[], bool], patience_s: float = PATIENCE_S) -> bool:
    """Wait for a condition; return whether it came true."""
    end_s = time.monotonic() + patience_s
    while not condition():
        if time.monotonic() > end_s:
            return False
        time.sleep(0.02)
    return True


@contextlib.contextmanager
def serving(folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Yield a service of the cell that has just been started."""
    words = ("serve", CELL, "--folder", str(folder), "--listen", "127.0.0.1:0")
    with program(*words, folder=folder) as process:
        yield process


def kill(process: subprocess.Popen[bytes]) -> None:
    """Kill a process, and wait until it is gone."""
    process.kill()
    process.wait()


def require_answer(folder: Path, process: subprocess.Popen[bytes]) -> None:
    """Wait until a service answers.

    Raises:
        SystemExit: It has ended, or does not in `PATIENCE_S`.
    """
    if (
        not until(lambda: answers(folder) or process.poll() is not None)
        or process.poll() is not None
    ):
        raise SystemExit(f"no service: {(folder / 'said').read_text()[-2000:]}")


def answers(folder: Path) -> bool:
    """Return whether a service of the folder answers."""
    with contextlib.suppress(RidDaqError), ServiceClient.at(str(socket_path_of(folder))) as client:
        client.cells()
        return True
    return False


def is_worker(pid: int) -> bool:
    """Return whether a process is there and a worker."""
    with contextlib.suppress(OSError):
        return b"rid_daq.worker" in Path(f"/proc/{pid}/cmdline").read_bytes()
    return False


def has_drives() -> bool:
    """Return whether the drives are on their bus."""
    try:
        return enabled_drives() >= 0
    except can.CanError:
        return False


def enabled_drives() -> int:
    """Return how many of the cell's drives are switched on, by their statuswords (6041h)."""
    cell = load_cell(CELL).config
    count = 0
    with can.Bus(interface=cell.can.interface, channel=cell.can.channel) as bus:
        for axis in cell.axes:
            read = bytes((0x40, 0x41, 0x60, 0, 0, 0, 0, 0))
            asked = can.Message(
                arbitration_id=0x600 + axis.node_id, data=read, is_extended_id=False
            )
            for _ in range(10):
                bus.send(asked)
                word = _answer(bus, 0x580 + axis.node_id)
                if word is not None:
                    count += word & STATE == ENABLED
                    break
            else:
                raise SystemExit(f"node {axis.node_id} does not answer: nobody knows its state")
    return count


def _answer(bus: can.BusABC, identifier: int) -> int | None:
    until_s = time.monotonic() + 2.0
    while time.monotonic() < until_s:
        answer = bus.recv(0.1)
        if answer is not None and answer.arbitration_id == identifier:
            return answer.data[4]
    return None


class Attacker:
    """Starts services of one folder and kills them.

    Args:
        folder: Theirs.
        chance: When they are killed.

    Attributes:
        tally: What that has left.
    """

    def __init__(self, folder: Path, chance: random.Random) -> None:
        self.folder = folder
        self.tally = Tally()
        self._chance = chance
        self._lease: str | None = None
        self._start_s = 2.0
        self._job_s = 10.0

    def kill_one(self) -> None:
        """Start a service, and kill it at a random moment."""
        with serving(self.folder) as process:
            if self._chance.random() < STARTING:
                time.sleep(self._chance.uniform(0.0, self._start_s))
                kill(process)
                self.tally.fell["its start"] += 1
                return
            began_s = time.monotonic()
            require_answer(self.folder, process)
            self._start_s = time.monotonic() - began_s
            with ServiceClient.at(str(socket_path_of(self.folder))) as client:
                self.look_at_rest(client)
                self._make_ready(client)
                self._strike(client, process)

    def look_at_rest(self, client: ServiceClient) -> None:
        """Have the worker of the service before end by itself, and look at the drives."""
        newest = client.ask("GET", "/jobs?limit=1")
        pid = newest[0]["pid"] if newest else None
        if pid is not None and not until(lambda: not is_worker(pid), REST_S):
            self.tally.still += 1
        self.tally.enabled += enabled_drives()

    def _make_ready(self, client: ServiceClient) -> None:
        path = f"/cells/{CELL}/lease"
        if self._lease is None:
            self._lease = str(client.ask("POST", path, {"seconds": LEASE_S})["key"])
        client.ask("PUT", path, {"seconds": LEASE_S}, self._lease)
        if client.cell(CELL).state is CellState.FAULT:
            client.run(CELL, "reset", {}, lease=self._lease)
        while client.cell(CELL).state is not CellState.READY:
            client.run(CELL, "check", {"seconds": 0.2}, lease=self._lease)

    def _strike(self, client: ServiceClient, process: subprocess.Popen[bytes]) -> None:
        """Ask for a recording, and kill the service at a random moment of the job's life."""
        said: list[Job] = []
        wanted = {"kind": "record", "request": {"motion": "motion.yaml"}}

        def ask() -> None:
            with contextlib.suppress(RidDaqError):  # killed before it answered
                told = client.ask("POST", f"/cells/{CELL}/jobs", wanted, self._lease)
                said.append(Job.model_validate(told))

        asking = threading.Thread(target=ask)
        began_s = time.monotonic()
        asking.start()
        if self._chance.random() < ASKING:
            time.sleep(self._chance.uniform(0.0, ASKING_S))
        elif until(
            lambda: bool(said) and self._is_over(said[0]), self._chance.uniform(0, self._job_s)
        ):
            self._job_s = time.monotonic() - began_s
        else:
            self._job_s *= 1.02  # a computer that others have made slow
        kill(process)
        asking.join()
        self.tally.accepted += [job.id for job in said]
        self.tally.fell[self._where(said[0]) if said else "the request"] += 1

    def _where(self, job: Job) -> str:
        """Return what a job was at, just after the kill."""
        if self._is_over(job):
            return "its end"
        motions = "motion" in self._kinds(job.id)
        control = None if job.pid is None else _control(job.pid)
        if control is not None:
            state, phase = control.task.state, control.task.phase
            if state is TaskState.MOVING:
                return "the approach" if phase is Phase.APPROACH else "the motion"
            return "the drives' start or stop"
        return "the writing of its result" if motions else "its preparation"

    def _is_over(self, job: Job) -> bool:
        return "ended" in self._kinds(job.id)

    def _kinds(self, job_id: str) -> Counter[str]:
        path = self.folder / STATE_FOLDER / "jobs" / f"{job_id}.jsonl"
        return Counter(event.kind for event in EventTail(path).read_new())

    def left(self) -> dict[str, Any]:
        """Return what all that has left, once a last service has been there."""
        with serving(self.folder) as process:
            require_answer(self.folder, process)
            with ServiceClient.at(str(socket_path_of(self.folder))) as client:
                self.look_at_rest(client)
        with contextlib.closing(open_database(self.folder / STATE_FOLDER / "service.db")) as base:
            jobs = JobStore(base).newest(limit=1_000_000)
        recordings = [job for job in jobs if job.kind == JobKind("record")]
        told = [self._kinds(job.id) for job in jobs]
        twice = sum(each["ended"] > 1 or each["motion"] > 1 for each in told)
        runs = len(list_runs(self.folder / "runs"))
        return {
            "accepted": len(self.tally.accepted),
            "lost": len(set(self.tally.accepted) - {job.id for job in jobs}),
            "done_twice": twice + max(0, runs - len(recordings)),
            "left_running": sum(not job.state.is_over for job in jobs),
            "workers_left": self.tally.still,
            "drives_enabled": self.tally.enabled,
            "runs": runs,
            "fell_on": self.tally.fell,
            "states": Counter(job.state.value for job in recordings),
        }


def _control(pid: int) -> ControlBlock | None:
    try:
        return ControlBlock.of_process(pid)
    except OSError:
        return None


def attack(kills: int, seed: int, until_s: float) -> dict[str, Any]:
    """Kill so many services of a cell of their own; return what that has left."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["XDG_RUNTIME_DIR"] = name
        (folder / "motion.yaml").write_text(MOTION)
        with program("mock", CELL, folder=folder):
            if not until(has_drives):
                raise SystemExit(f"no drives: {(folder / 'said').read_text()[-2000:]}")
            attacker = Attacker(folder, random.Random(seed))
            done = 0
            while done < kills and time.time() < until_s:
                attacker.kill_one()
                done += 1
                if done % 20 == 0:
                    tally = attacker.tally
                    bad = f"{tally.enabled} drives enabled, {tally.still} workers left"
                    print(f"row {seed}: {done} kills, {bad}, {dict(tally.fell)}", flush=True)
            return {"kills": done, **attacker.left()}


def main() -> int:
    """Kill, look, and print; the last line is one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=20, metavar="N")
    parser.add_argument("--lanes", type=int, default=2)
    parser.add_argument("--minutes", type=float, default=600.0)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    began_s = time.time()
    until_s = began_s + 60.0 * options.minutes
    shares = [(options.kills + lane) // options.lanes for lane in range(options.lanes)]
    with ProcessPoolExecutor(options.lanes, get_context("spawn")) as pool:
        lanes = [
            pool.submit(attack, share, options.seed + lane, until_s)
            for lane, share in enumerate(shares)
        ]
        found = [lane.result() for lane in lanes]
    total: Counter[str] = Counter()
    fell_on: Counter[str] = Counter()
    states: Counter[str] = Counter()
    for each in found:
        fell_on.update(each.pop("fell_on"))
        states.update(each.pop("states"))
        total.update(each)
    bad = ("lost", "done_twice", "left_running", "workers_left", "drives_enabled")
    holds = total["kills"] > 0 and not any(total[each] for each in bad)
    result = {
        "name": "service_kills",
        **total,
        "fell_on": dict(fell_on.most_common()),
        "states": dict(states),
        "minutes": round((time.time() - began_s) / 60.0, 1),
        "bar": "0 lost, 0 done twice, 0 left running, 0 workers left, 0 drives enabled",
        "holds": holds,
    }
    print(json.dumps(result))
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
