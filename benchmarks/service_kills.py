"""State after `kill -9` of the service: `python -m benchmarks.service_kills --kills N`.

The simulated drives run in another program (`rid-daq mock`) and are never killed. One service after
the other is killed at a random time: while it starts, while it stores a new job, or while the job
prepares, moves or writes its result. The next service starts at once, as with systemd. Before the
next service gets a request, the worker of the killed service must have ended by itself, and no
drive may be enabled. `--lanes` sets the number of services that are tested in parallel, each with a
separate cell and folder. `--minutes` limits the duration; the test then ends early and reports the
number of kills.

At the end the service must know every accepted job; no job may be running, and none may have run
twice. Other load on the computer does not affect the result. The last line is one JSON object.
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
from rid_daq.service.sockets import socket_path_of
from rid_daq.service.store.database import open_database
from rid_daq.service.store.jobs import JobStore
from rid_daq.service.store.state_folder import STATE_FOLDER
from rid_daq.service.workers.running_job import EventTail

PATIENCE_S: Final = 300.0
CELL: Final = "ir361"
ENABLED: Final = 0x27
STATE: Final = 0x6F
LEASE_S: Final = 3600.0
REST_S: Final = 180.0
STARTING: Final = 0.15
"""Fraction of the kills that happen during a service's start."""

ASKING: Final = 0.25
"""Fraction of the kills after the start that happen within `ASKING_S` after a request."""

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
    """Results of the kills so far.

    Attributes:
        fell: Number of kills for each activity of the service at the time of the kill.
        accepted: Jobs that the service has accepted.
        enabled, still: Numbers of enabled drives, and of workers still running, after the kills;
            both must be 0.
    """

    fell: Counter[str] = field(default_factory=Counter)
    accepted: list[str] = field(default_factory=list)
    enabled: int = 0
    still: int = 0


@contextlib.contextmanager
def program(*words: str, folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Start a rid-daq command and yield its process; end it afterwards."""
    with (folder / "output").open("ab") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", "rid_daq", *words], stdout=log, stderr=log
        )
    try:
        yield process
    finally:
        if process.poll() is None:
            process.terminate()
            process.wait(PATIENCE_S)


def wait_until(condition: Callable[[], bool], patience_s: float = PATIENCE_S) -> bool:
    """Wait for a condition; return False after a timeout."""
    end_s = time.monotonic() + patience_s
    while not condition():
        if time.monotonic() > end_s:
            return False
        time.sleep(0.02)
    return True


@contextlib.contextmanager
def serving(folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Start a service of the cell and yield its process."""
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
        SystemExit: It has ended, or does not answer within `PATIENCE_S`.
    """
    if (
        not wait_until(lambda: service_answers(folder) or process.poll() is not None)
        or process.poll() is not None
    ):
        raise SystemExit(f"the service does not answer: {(folder / 'output').read_text()[-2000:]}")


def service_answers(folder: Path) -> bool:
    """Return True if a service of the folder answers."""
    with contextlib.suppress(RidDaqError), ServiceClient.at(str(socket_path_of(folder))) as client:
        client.cells()
        return True
    return False


def is_worker(pid: int) -> bool:
    """Return True if a process exists and is a worker."""
    with contextlib.suppress(OSError):
        return b"rid_daq.worker" in Path(f"/proc/{pid}/cmdline").read_bytes()
    return False


def has_drives() -> bool:
    """Return True if the drives are on their bus."""
    try:
        return enabled_drives() >= 0
    except can.CanError:
        return False


def enabled_drives() -> int:
    """Return the number of enabled drives of the cell, from their statuswords (6041h)."""
    cell = load_cell(CELL).config
    count = 0
    with can.Bus(interface=cell.can.interface, channel=cell.can.channel) as bus:
        for axis in cell.axes:
            read = bytes((0x40, 0x41, 0x60, 0, 0, 0, 0, 0))
            request = can.Message(
                arbitration_id=0x600 + axis.node_id, data=read, is_extended_id=False
            )
            for _ in range(10):
                bus.send(request)
                word = _answer(bus, 0x580 + axis.node_id)
                if word is not None:
                    count += word & STATE == ENABLED
                    break
            else:
                raise SystemExit(f"node {axis.node_id} does not answer: its state is unknown")
    return count


def _answer(bus: can.BusABC, identifier: int) -> int | None:
    until_s = time.monotonic() + 2.0
    while time.monotonic() < until_s:
        answer = bus.recv(0.1)
        if answer is not None and answer.arbitration_id == identifier:
            return answer.data[4]
    return None


class Attacker:
    """Tester that starts and kills the services of one folder.

    Args:
        folder: Folder of the services.
        chance: Random generator of the times of the kills.

    Attributes:
        tally: Results so far.
    """

    def __init__(self, folder: Path, chance: random.Random) -> None:
        self.folder = folder
        self.tally = Tally()
        self._chance = chance
        self._lease: str | None = None
        self._start_s = 2.0
        self._job_s = 10.0

    def kill_one(self) -> None:
        """Start a service and kill it at a random time."""
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
        """Wait for the previous service's worker to end, and count the enabled drives."""
        newest = client.ask("GET", "/jobs?limit=1")
        pid = newest[0]["pid"] if newest else None
        if pid is not None and not wait_until(lambda: not is_worker(pid), REST_S):
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
        """Request a recording, and kill the service at a random time during the job."""
        accepted: list[Job] = []
        body = {"kind": "record", "request": {"motion": "motion.yaml"}}

        def ask() -> None:
            with contextlib.suppress(RidDaqError):  # killed before the service had answered
                job = client.ask("POST", f"/cells/{CELL}/jobs", body, self._lease)
                accepted.append(Job.model_validate(job))

        asking = threading.Thread(target=ask)
        began_s = time.monotonic()
        asking.start()
        if self._chance.random() < ASKING:
            time.sleep(self._chance.uniform(0.0, ASKING_S))
        elif wait_until(
            lambda: bool(accepted) and self._is_over(accepted[0]),
            self._chance.uniform(0, self._job_s),
        ):
            self._job_s = time.monotonic() - began_s
        else:
            self._job_s *= 1.02  # adapt to a computer that has become slower
        kill(process)
        asking.join()
        self.tally.accepted += [job.id for job in accepted]
        self.tally.fell[self._activity(accepted[0]) if accepted else "the request"] += 1

    def _activity(self, job: Job) -> str:
        """Return the activity of a job at the time of the kill."""
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
        """Return the final results, after a last service has started."""
        with serving(self.folder) as process:
            require_answer(self.folder, process)
            with ServiceClient.at(str(socket_path_of(self.folder))) as client:
                self.look_at_rest(client)
        with contextlib.closing(open_database(self.folder / STATE_FOLDER / "service.db")) as base:
            jobs = JobStore(base).newest(limit=1_000_000)
        recordings = [job for job in jobs if job.kind == JobKind("record")]
        events = [self._kinds(job.id) for job in jobs]
        twice = sum(each["ended"] > 1 or each["motion"] > 1 for each in events)
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
    """Kill `kills` services of a separate cell; return the results."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["XDG_RUNTIME_DIR"] = name
        (folder / "motion.yaml").write_text(MOTION)
        with program("mock", CELL, folder=folder):
            if not wait_until(has_drives):
                raise SystemExit(
                    f"the drives did not start: {(folder / 'output').read_text()[-2000:]}"
                )
            attacker = Attacker(folder, random.Random(seed))
            done = 0
            while done < kills and time.time() < until_s:
                attacker.kill_one()
                done += 1
                if done % 20 == 0:
                    tally = attacker.tally
                    bad = f"{tally.enabled} drives enabled, {tally.still} workers left"
                    print(f"lane {seed}: {done} kills, {bad}, {dict(tally.fell)}", flush=True)
            return {"kills": done, **attacker.left()}


def main() -> int:
    """Measure, and print the figures; the last line is one JSON object."""
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
        "bar": "no job lost, run twice or left running; no worker left, no drive enabled",
        "holds": holds,
    }
    print(json.dumps(result))
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
