"""Random and mutated byte streams at a service: `python -m benchmarks.framing --minutes 10`.

Eight senders open connections to one `rid-daq serve` of a simulated cell and send correct and
mutated HTTP requests and WebSocket frames (`benchmarks/framing_streams.py`), at once or in small
parts. Some disconnect early and some stay silent. At the same time STOP is pressed, by new
connections and over one `/api/v1/stop-line`.

Requirements:
- No process of the service ends or writes a traceback.
- No STOP is lost, and the p99 latency is at most 50 ms.
- The memory of both processes is measured without open connections, after the first fifth of the
  time and at the end. It grows by at most 5 %.

`--seed` repeats the streams. The last line is one JSON object.
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
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from benchmarks.framing_streams import Streams
from benchmarks.stop_presser import Pressed, StopLineClient, press_http, raise_priority
from rid_daq.service.client import ServiceClient
from rid_daq.service.sockets import socket_path_of

SENDERS: Final = 8
CELL: Final = "ir361"
PATIENCE_S: Final = 120.0
CALM_S: Final = 12.0
STOP_BAR_MS: Final = 50.0
MEMORY_BAR: Final = 1.05
PRESS_S: Final = 0.1


@dataclass(frozen=True)
class Served:
    """A running service.

    Attributes:
        process: Process of the service.
        port: TCP port.
        token: Secret of a viewer's token.
        log: File with its output.
    """

    process: subprocess.Popen[bytes]
    port: int
    token: str
    log: Path

    def processes(self) -> dict[int, str]:
        """Return the process ids of the service and of its front process, with their names."""
        pid = self.process.pid
        found = {pid: "service"}
        for child in map(int, Path(f"/proc/{pid}/task/{pid}/children").read_text().split()):
            with contextlib.suppress(OSError):
                words = Path(f"/proc/{child}/cmdline").read_bytes()
                if b"rid_daq.service.front" in words:
                    found[child] = "front"
        return found

    def memory_kb(self) -> dict[str, int]:
        """Return the resident memory of each process [kB]."""
        return {
            name: int(re.findall(r"VmRSS:\s+(\d+)", Path(f"/proc/{pid}/status").read_text())[0])
            for pid, name in self.processes().items()
        }


@contextlib.contextmanager
def serving(folder: Path) -> Iterator[Served]:
    """Start a service and yield it with a viewer's token; end it afterwards."""
    os.environ["XDG_RUNTIME_DIR"] = str(folder)
    words = [sys.executable, "-m", "rid_daq", "serve", CELL, "--folder", str(folder)]
    log = folder / "output"
    with log.open("wb") as output:
        process = subprocess.Popen(
            [*words, "--listen", "127.0.0.1:0"], stdout=output, stderr=output
        )
    try:
        until_s = time.monotonic() + PATIENCE_S
        while not (found := re.search(r"127\.0\.0\.1:(\d+)/", log.read_text())):
            if process.poll() is not None or time.monotonic() > until_s:
                raise SystemExit(f"the service did not start: {log.read_text()}")
            time.sleep(0.05)
        with ServiceClient.at(str(socket_path_of(folder))) as client:
            body = {"name": "viewer", "role": "viewer", "person": False}
            token = str(client.ask("POST", "/tokens", body)["secret"])
        yield Served(process, int(found[1]), token, log)
    finally:
        process.terminate()
        process.wait(PATIENCE_S)


def send_streams(
    port: int, token: str, seed: int, until_s: float, sent: multiprocessing.Queue[int]
) -> None:
    """Send streams until a time, as the main function of a sender's process."""
    os.nice(10)
    chance = random.Random(seed)
    streams, count = Streams(chance, port, token), 0
    while time.monotonic() < until_s:
        with contextlib.suppress(OSError):
            send(port, streams.stream(), chance)
        count += 1
    sent.put(count)


def send(port: int, stream: bytes, chance: random.Random) -> None:
    """Send one stream over a new connection, in one of several ways."""
    with socket.create_connection(("127.0.0.1", port), timeout=5.0) as line:
        line.settimeout(0.2)
        step = chance.choice((len(stream) or 1, 1000, 7))
        for begin in range(0, min(len(stream), 400 * step), step):
            line.sendall(stream[begin : begin + step])
        if chance.random() < 0.3:
            return  # without waiting for an answer
        if chance.random() < 0.5:
            line.shutdown(socket.SHUT_WR)
        for _ in range(3):
            if not line.recv(65536):
                return


def press(served: Served, until_s: float) -> dict[str, Pressed]:
    """Press STOP in both ways until a time."""
    found, number = {"http": Pressed(), "line": Pressed()}, 0
    with StopLineClient.at(served.port) as line:
        while time.monotonic() < until_s:
            press_http(served.port, CELL, found["http"])
            line.press(CELL, number, found["line"])
            number += 1
            time.sleep(PRESS_S)
    return found


def fuzz(served: Served, seed: int, seconds: float) -> tuple[dict[str, Pressed], int]:
    """Send streams for a time; return the answers to STOPs, and the number of streams."""
    context = multiprocessing.get_context("spawn")
    sent: multiprocessing.Queue[int] = context.Queue()
    until_s = time.monotonic() + seconds
    senders = [
        context.Process(
            target=send_streams,
            args=(served.port, served.token, seed + number, until_s, sent),
            daemon=True,
        )
        for number in range(SENDERS)
    ]
    for sender in senders:
        sender.start()
    try:
        pressed = press(served, until_s)
        return pressed, sum(sent.get(timeout=PATIENCE_S) for _ in senders)
    finally:
        for sender in senders:
            sender.kill()
            sender.join()


def main() -> int:
    """Measure, and print the figures; the last line is one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    seconds = 60.0 * options.minutes
    with tempfile.TemporaryDirectory() as name, serving(Path(name)) as served:
        raise_priority()
        warmed, streams = fuzz(served, options.seed, seconds / 5)
        time.sleep(CALM_S)
        before_kb, processes = served.memory_kb(), served.processes()
        pressed, more = fuzz(served, options.seed + SENDERS, 4 * seconds / 5)
        time.sleep(CALM_S)
        after_kb = served.memory_kb()
        alive = served.process.poll() is None and served.processes() == processes
        log = served.log.read_text(errors="replace")
    growth = {name: after_kb.get(name, 0) / kb for name, kb in before_kb.items()}
    tracebacks = log.count("Traceback")
    for way in pressed:
        pressed[way].took_ms += warmed[way].took_ms
        pressed[way].lost += warmed[way].lost
        print(f"STOP, {way}: {pressed[way].words}")
    for name, ratio in growth.items():
        kb = f"{before_kb[name]} kB, then {after_kb.get(name)} kB"
        print(f"memory of the {name}: {kb} ({ratio:.3f})")
    p99_ms = max(each.quantile(0.99) for each in pressed.values())
    lost = sum(each.lost for each in pressed.values())
    flat = len(growth) == 2 and all(0.0 < ratio <= MEMORY_BAR for ratio in growth.values())
    holds = alive and not tracebacks and not lost and p99_ms <= STOP_BAR_MS and flat
    result = {
        "name": "framing",
        "value": round(p99_ms, 1),
        "unit": "ms from the press of STOP to the answer; the larger p99 of WebSocket and HTTP",
        "n": sum(len(each.took_ms) for each in pressed.values()),
        "streams": streams + more,
        "minutes": options.minutes,
        "lost": lost,
        "alive": alive,
        "tracebacks": tracebacks,
        **{f"memory_ratio_{name}": round(ratio, 3) for name, ratio in growth.items()},
        "load": round(os.getloadavg()[0], 1),
        "bar": f"all processes survive, no traceback, no STOP lost, p99 at most {STOP_BAR_MS:g} ms,"
        f" memory at most {MEMORY_BAR:g} times that of the start",
        "holds": holds,
    }
    if tracebacks:
        print(log[-3000:])
    print(json.dumps(result))
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
