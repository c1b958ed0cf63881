"""Time of lock-step cells whose cyclic task runs in the process of hub and drives.

`python -m benchmarks.lockstep [--quick]` measures three things through the command line:

1. the time of one cycle of three axes with a force plate: the slope between a short and a long
   motion, so that start-up does not count;
2. the demo;
3. an hour of motion of the cell that `init` makes.

Each is repeated with a process for the cyclic task, and the rows of all recordings must be equal
byte for byte. `--quick` uses shorter motions, four periods in the demo and 100 s instead of an
hour, scaled to an hour with its start-up. The last line is one JSON object. The exit code is 1 if a
time limit does not hold or if recordings differ.
"""

from __future__ import annotations

import hashlib
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from acquisition.journal.cycle_reader import CycleReader
from acquisition.journal.plate import PLATE_RECORDING, read_plate_journal
from acquisition.runs.manifest import RECORDING

CYCLE_BAR_MS: Final = 0.3
DEMO_BAR_S: Final = 30.0
HOUR_BAR_S: Final = 240.0
PERIOD_S: Final = 10.0
PROCESSES: Final = "--processes"
"""Argument with which this module is `rid-daq` with a process for each cyclic task."""

MOTION: Final = """\
kind: fourier
robot: {robot}
period_s: {period_s}
periods: {periods}
ramp_s: 2.0
joints:
  - {{joint: axis1, offset: 0.1, sine: [0.3, 0.1], cosine: [0.1, 0.05]}}
  - {{joint: axis2, offset: -0.15, sine: [0.2, 0.1], cosine: [0.1, 0.05]}}
  - {{joint: axis3, offset: 0.2, sine: [0.3, 0.1], cosine: [0.1, 0.05]}}
"""


@dataclass(frozen=True)
class Command:
    """A command that has ended.

    Attributes:
        wall_s: Wall time [s].
        processor_s: Processor time of all its processes [s].
        rows: Number of recorded rows.
        plates: Plate rows of its runs, oldest run first.
        digest: Hash of all recorded rows.
    """

    wall_s: float
    processor_s: float
    rows: int
    plates: list[bytes]
    digest: str

    def equals(self, other: Command) -> bool:
        """Return True if all recorded rows are equal.

        The plate is recorded until the program ends the stream. Its last rows, after the motion,
        depend on the computer's clock and are not compared.
        """
        return self.digest == other.digest and all(
            ours[: len(theirs)] == theirs[: len(ours)]
            for ours, theirs in zip(self.plates, other.plates, strict=True)
        )


def run_program(runs: Path, *arguments: str, processes: bool) -> Command:
    """Run `rid-daq` with a new folder of runs; read its recordings.

    Raises:
        CalledProcessError: The command failed.
    """
    program = [sys.executable, "-m", "rid_daq"]
    if processes:
        program = [sys.executable, "-m", "benchmarks.lockstep", PROCESSES]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    began_s = time.monotonic()
    done = subprocess.run(
        [*program, *arguments, "--runs", str(runs)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        check=False,
    )
    wall_s = time.monotonic() - began_s
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        print(done.stdout.decode(), file=sys.stderr)
        done.check_returncode()
    digest, rows, plates = hashlib.sha256(), 0, []
    for run in sorted(path.parent for path in runs.rglob(RECORDING)):
        with CycleReader(run / RECORDING) as reader:
            for block in reader.rows():
                digest.update(block.tobytes())
                rows += len(block)
        if (run / PLATE_RECORDING).exists():
            plates.append(read_plate_journal(run / PLATE_RECORDING).rows.tobytes())
    processor_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Command(wall_s, processor_s, rows, plates, digest.hexdigest())


def record(folder: Path, cell: str, robot: str, seconds: float, *, processes: bool) -> Command:
    """Record a periodic motion of about `seconds` on a cell."""
    periods = max(2, round(seconds / PERIOD_S))
    label = f"{robot}-{periods}-{'processes' if processes else 'hosted'}"
    motion = folder / f"{label}.yaml"
    motion.write_text(MOTION.format(robot=robot, period_s=PERIOD_S, periods=periods))
    return run_program(folder / label, "record", cell, str(motion), processes=processes)


def describe(what: str, hosted: Command, processes: Command) -> None:
    """Print the times of a command in both forms."""
    equal = "equal recordings" if hosted.equals(processes) else "DIFFERENT RECORDINGS"
    print(
        f"{what}: {hosted.wall_s:.1f} s ({hosted.processor_s:.1f} s of processor time);"
        f" with a process for the cyclic task {processes.wall_s:.1f} s"
        f" ({processes.processor_s:.1f} s); {hosted.rows} rows, {equal}",
        flush=True,
    )


def main() -> int:
    """Measure, and print the figures; the last line is one JSON object."""
    quick = "--quick" in sys.argv
    short_s, long_s, hour_s = (20.0, 60.0, 100.0) if quick else (60.0, 360.0, 3600.0)
    load = os.getloadavg()[0]
    print(f"{os.cpu_count()} processors, load {load:.1f} at the beginning", flush=True)
    pairs: dict[str, tuple[Command, Command]] = {}
    with tempfile.TemporaryDirectory(prefix="rid-lockstep-") as name:
        folder = Path(name)
        subprocess.run(
            [sys.executable, "-m", "rid_daq", "init", name], stdout=subprocess.DEVNULL, check=True
        )
        for what, cell, robot, seconds in (
            ("short", "ir361", "ir361", short_s),
            ("long", "ir361", "ir361", long_s),
            ("hour", str(folder / "cell.yaml"), "my_robot", hour_s),
        ):
            hosted = record(folder, cell, robot, seconds, processes=False)
            pairs[what] = hosted, record(folder, cell, robot, seconds, processes=True)
            describe(f"{seconds:g} s of motion, {robot}", *pairs[what])
        periods = f"--periods={4 if quick else 16}"
        pairs["demo"] = (
            run_program(folder / "demo", "demo", periods, processes=False),
            run_program(folder / "demo-processes", "demo", periods, processes=True),
        )
        describe("demo", *pairs["demo"])
    cycles = pairs["long"][0].rows - pairs["short"][0].rows
    cycle_ms, processes_ms = (
        1e3 * (long.wall_s - short.wall_s) / cycles
        for long, short in zip(pairs["long"], pairs["short"], strict=True)
    )
    demo_s = pairs["demo"][0].wall_s
    hour_wall_s = pairs["hour"][0].wall_s * 3600.0 / hour_s
    print(f"cycle: {cycle_ms:.2f} ms; with a process for the cyclic task {processes_ms:.2f} ms")
    equal = all(hosted.equals(processes) for hosted, processes in pairs.values())
    bars = {
        "cycle": cycle_ms <= CYCLE_BAR_MS,
        "demo": demo_s <= DEMO_BAR_S,
        "hour": hour_wall_s <= HOUR_BAR_S,
        "equal recordings": equal,
    }
    holds = all(bars.values())
    result = {
        "name": "lockstep",
        "value": round(cycle_ms, 3),
        "unit": "ms wall per cycle of three axes with plate",
        "ratios": {
            "cycle with a process for the cyclic task": round(processes_ms / cycle_ms, 2),
            "demo with processes": round(pairs["demo"][1].wall_s / demo_s, 2),
            "real time of an hour": round(hour_wall_s / 3600.0, 3),
        },
        "demo_s": round(demo_s, 1),
        "hour_s": round(hour_wall_s, 1),
        "load": round(load, 1),
        "bar": f"cycle at most {CYCLE_BAR_MS} ms, demo {DEMO_BAR_S:g} s, an hour of motion"
        f" {HOUR_BAR_S:g} s, recordings equal byte for byte to those of the processes",
        "failed": [bar for bar, held in bars.items() if not held],
        "holds": holds,
    }
    print(json.dumps(result))
    return 0 if holds else 1


def run_with_processes() -> None:
    """Run `rid-daq` with a process for each cyclic task."""
    from mock_hw.cell import SimulatedCell
    from rid_daq.app import main as run

    SimulatedCell.runs_masters = property(lambda _: False)  # type: ignore[method-assign, assignment]
    sys.argv.remove(PROCESSES)
    run()


if __name__ == "__main__":
    if PROCESSES in sys.argv:
        run_with_processes()
    else:
        sys.exit(main())
