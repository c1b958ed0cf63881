"""Wall time of `rid-daq demo`, compared with its limit and with the duration of its motions.

`python -m benchmarks.demo [--quick]`; the last line is one JSON object. The lower limit is the time
of the simulation without any computation. It is measured in the same run: processes exchange as
many packets as the lock-step buses need.
"""

from __future__ import annotations

import json
import multiprocessing
import socket
import subprocess
import sys
import tempfile
import time

from benchmarks.short_form import is_short

BAR_S = 120.0
CYCLE_S = 0.008
WAKES_PER_CYCLE = 4
"""Process switches of one lock-step cycle: two to the master and two to the drives."""


def echo(peer: socket.socket) -> None:
    """Answer every packet until the other end closes."""
    while packet := peer.recv(256):
        peer.send(packet)


def switch_s(rounds: int = 20_000) -> float:
    """Return the time of one packet from a process to another [s]."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    process = multiprocessing.get_context("spawn").Process(target=echo, args=(theirs,), daemon=True)
    process.start()
    theirs.close()
    packet = bytes(64)
    ours.send(packet)
    ours.recv(256)
    began_s = time.perf_counter()
    for _ in range(rounds):
        ours.send(packet)
        ours.recv(256)
    took_s = time.perf_counter() - began_s
    ours.close()
    process.join(10.0)
    return took_s / rounds / 2


def main() -> int:
    """Measure, and print the figures; the last line is one JSON object."""
    periods = 4 if is_short(__doc__) else 16
    with tempfile.TemporaryDirectory() as runs:
        began_s = time.perf_counter()
        done = subprocess.run(
            [
                sys.executable,
                "-m",
                "rid_daq",
                "demo",
                f"--runs={runs}",
                f"--periods={periods}",
                "--json",
            ],
            stdout=subprocess.PIPE,
            check=True,
        )
        took_s = time.perf_counter() - began_s
    motion_s = sum(run["rows"] for run in json.loads(done.stdout)["runs"]) * CYCLE_S
    bare_s = motion_s / CYCLE_S * WAKES_PER_CYCLE * switch_s()
    print(f"{periods} periods: {took_s:.1f} s for {motion_s:.0f} s of motion on each of two robots")
    holds = took_s <= BAR_S
    result = {
        "name": "demo",
        "value": round(took_s, 1),
        "unit": "s wall, program start to report",
        "ratios": {
            "real time": round(took_s / motion_s, 3),
            "packets between processes, without computation": round(took_s / bare_s, 1),
        },
        "bar": f"at most {BAR_S:g} s for 16 periods of 10 s, the 20-point validation and the paths",
        "holds": holds,
    }
    print(json.dumps(result))
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
