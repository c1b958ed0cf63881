"""Start-up time of the program, compared with `python -c 'import numpy, scipy'`.

The processor time of whole processes (the lowest of several starts) is measured for `--version`,
for the list of a hundred runs, for the slowest help of a command, and for a whole `check` on a
simulated cell with its processes. For `check`, the wall time until its first line is measured too.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from acquisition.runs.folder import RunFolder
from benchmarks.short_form import is_short
from rid_daq.command_line.root import COMMANDS

PEER: Final = (sys.executable, "-c", "import numpy, scipy")
PROGRAM: Final = (sys.executable, "-m", "rid_daq")
RUNS: Final = 100
ROUNDS: Final = 7
PEER_S: Final = 0.09
"""Time of `python -c 'import numpy, scipy'` on the idle computer on which the limits were set [s].
"""

BARS_S: Final = {"--version": 0.1, "runs": 0.3, "--help": 0.3, "check": 1.0, "whole check": 2.4}


def processor_s(command: Sequence[str]) -> float:
    """Return the processor time that a command takes [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, stdout=subprocess.DEVNULL, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def check_command(folder: Path) -> tuple[str, ...]:
    """Return a short `check` of a simulated cell; its test file is written into a folder."""
    return (*PROGRAM, "check", "ir361", "--seconds", "0.1", "--runs", str(folder))


def first_line_s(folder: Path) -> float:
    """Return the wall time until the first line of `check` [s]."""
    began_s = time.monotonic()
    with subprocess.Popen(
        check_command(folder),
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        taken_s = time.monotonic() - began_s
        process.stdout.read()
    if process.returncode:
        raise SystemExit(f"check ended with exit code {process.returncode}")
    return taken_s


def main() -> int:
    """Measure, and print the figures; the last line is one JSON object."""
    helps = {name: processor_s((*PROGRAM, name, "--help")) for name in COMMANDS}
    slowest = max(helps, key=lambda name: helps[name])
    with TemporaryDirectory(prefix="rid-startup-") as name:
        runs = Path(name) / "runs"
        for number in range(RUNS):
            RunFolder.create(runs, f"run {number}")
        # in turns, so that other load on the computer affects all measurements alike
        rounds = [
            {
                "peer": processor_s(PEER),
                "--version": processor_s((*PROGRAM, "--version")),
                "runs": processor_s((*PROGRAM, "runs", "--runs", str(runs))),
                "--help": processor_s((*PROGRAM, slowest, "--help")),
                "check": first_line_s(runs),
                "whole check": processor_s(check_command(runs)),
            }
            for _ in range(2 if is_short(__doc__) else ROUNDS)
        ]
    taken = {what: min(each[what] for each in rounds) for what in rounds[0]}
    peer_s = taken.pop("peer")
    print(f"python -c 'import numpy, scipy': {peer_s:.3f} s of processor time")
    ratios, held = {}, []
    for what, bar_s in BARS_S.items():
        ratios[what] = taken[what] / peer_s
        held.append(ratios[what] <= bar_s / PEER_S)
        more = {"--help": f", the slowest: {slowest}", "check": ", wall time to the first line"}
        print(
            f"{what}{more.get(what, '')}: {taken[what]:.3f} s, {ratios[what]:.2f} times the peer"
            f" (at most {bar_s / PEER_S:.2f})"
        )
    result = {
        "name": "startup",
        "value": round(taken["--help"], 3),
        "unit": f"s of processor time for --help of {slowest}",
        "ratios": {what: round(ratio, 2) for what, ratio in ratios.items()},
        "seconds": {what: round(each, 3) for what, each in taken.items()},
        "bar": ", ".join(f"{what} {bar_s:g} s" for what, bar_s in BARS_S.items())
        + f" if the import of numpy and scipy takes {PEER_S:g} s",
        "holds": all(held),
    }
    print(json.dumps(result))
    return 0 if all(held) else 1


if __name__ == "__main__":
    sys.exit(main())
