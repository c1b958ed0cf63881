"""Memory growth of a service: `python -m benchmarks.service_memory`.

The service first gets 10,000 requests. Then it makes recordings of 30 simulated minutes on a
simulated cell, as fast as possible, for 8 simulated hours in total. One viewer is connected. Three
figures show the growth of memory:
- the service at the end of the requests, relative to that after a tenth of the requests;
- the service at the end, relative to that after the first recording;
- the processes of each recording after nine tenths of it, relative to those after one tenth.

The last line is one JSON object.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from websockets.sync.client import unix_connect

from acquisition.task.control_block import ControlBlock
from benchmarks.service import MOTION, Served, serving
from benchmarks.service_stops import PATIENCE_S
from rid_daq.service.records import Job
from rid_daq.service.sockets import socket_path_of

REQUESTS: Final = 10_000
HOURS: Final = 8.0
EACH_S: Final = 1800.0
CYCLE_S: Final = 0.008
BAR: Final = 1.05


def memory_bytes(pid: int) -> int:
    """Return the private memory of a process in RAM plus its part of shared memory (PSS).

    Mapped files are excluded: the part that is attributed to a process grows when another program
    that uses the file ends.
    """
    total = 0
    with contextlib.suppress(OSError):
        for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines():
            if line.startswith(("Pss_Anon:", "Pss_Shmem:")):
                total += 1024 * int(line.split()[1])
    return total


def tree(pid: int) -> list[int]:
    """Return a process and all its descendants."""
    found = [pid]
    with contextlib.suppress(OSError):
        for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
            found += tree(int(child))
    return found


@contextlib.contextmanager
def viewer_connected(folder: Path) -> Iterator[list[int]]:
    """Connect a viewer to the service; yield the number of its messages."""
    count = [0]
    with unix_connect(str(socket_path_of(folder)), "ws://localhost/api/v1/ws") as socket:

        def read() -> None:
            for _ in socket:
                count[0] += 1

        reading = threading.Thread(target=read, daemon=True)
        reading.start()
        yield count


def send_requests(served: Served) -> float:
    """Send the requests; return the memory after all requests over that after the first tenth."""
    paths = ("/cells/ir361", "/jobs?limit=5", "/runs?limit=5", "/cells/ir361/preflight")
    before = 0
    for number in range(REQUESTS):
        served.client.ask("GET", paths[number % len(paths)])
        if number == REQUESTS // 10:
            before = memory_bytes(served.server)
    return memory_bytes(served.server) / before


def record_half_an_hour(served: Served) -> float:
    """Record for half an hour; return the memory after nine tenths over that after one tenth."""
    body = {
        "kind": "record",
        "request": {"motion": "motion.yaml", "simulation": {"pace": None}},
        "on_lost_client": "finish",
    }
    job = Job.model_validate(served.client.ask("POST", "/cells/ir361/jobs", body, served.lease))
    assert job.pid is not None
    sizes = []
    for share in (0.1, 0.9):
        until_s = time.monotonic() + 10.0 * PATIENCE_S
        while _cycles(job.pid) < share * EACH_S / CYCLE_S:
            over = served.client.job(job.id)
            if over.state.is_over or time.monotonic() > until_s:
                raise SystemExit(f"the recording has ended: {over.state.value} {over.reason}")
            time.sleep(0.2)
        sizes.append(sum(memory_bytes(each) for each in tree(job.pid)))
    served.client.follow(job).require_done()
    return sizes[1] / sizes[0]


def _cycles(pid: int) -> int:
    with contextlib.suppress(OSError):
        control = ControlBlock.of_process(pid)
        return 0 if control is None else control.task.cycles
    return 0


def main() -> int:
    """Measure, and print the figures; the last line is one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=HOURS, help="simulated time [h]")
    hours: float = parser.parse_args().hours
    began_s, own = time.monotonic(), []
    with tempfile.TemporaryDirectory() as name, serving(Path(name)) as served:
        folder = Path(name)
        (folder / "motion.yaml").write_text(
            MOTION.replace("periods: 1000", f"periods: {round(EACH_S / 2.0)}")
        )
        by_requests = send_requests(served)
        first = now = 0
        with viewer_connected(folder) as count:
            for number in range(max(2, round(3600.0 * hours / EACH_S))):
                served.client.ask("PUT", "/cells/ir361/lease", {"seconds": 3600.0}, served.lease)
                if served.client.cell("ir361").state != "ready":
                    served.client.run("ir361", "check", {"seconds": 0.2}, lease=served.lease)
                own.append(record_half_an_hour(served))
                now = memory_bytes(served.server)
                first = first or now
                print(
                    f"{(number + 1) * EACH_S / 3600.0:.1f} h: service {now / 1e6:.1f} MB,"
                    f" growth of the recording's processes {own[-1]:.3f} times",
                    flush=True,
                )
        by_hours = now / first
        messages = count[0]
    holds = max(by_requests, by_hours, *own) <= BAR and messages > 0
    result = {
        "name": "service_memory",
        "requests": REQUESTS,
        "requests_ratio": round(by_requests, 3),
        "simulated_hours": len(own) * EACH_S / 3600.0,
        "hours_ratio": round(by_hours, 3),
        "recordings_ratio": round(max(own), 3),
        "messages_seen": messages,
        "minutes": round((time.monotonic() - began_s) / 60.0, 1),
        "load": round(os.getloadavg()[0], 1),
        "bar": f"at most {BAR:g} times",
        "holds": holds,
    }
    print(json.dumps(result))
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
