"""Time and memory of recording an hour of motion and six minutes: `python -m benchmarks.recording`.

The command line records the periodic motion of a new simulated cell in lock-step: first for six
minutes, then for an hour. The time must not grow faster than the motion's duration, and the peak
memory of the processes must not grow with this duration. Then the long run is averaged and
identified. `--long-s` and `--short-s` set the durations; the last line is one JSON object.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

TIME_BAR_PER_LENGTH: Final = 1.05
MEMORY_BAR: Final = 1.1
READ_BAR_MB: Final = 300.0
PERIOD_S: Final = 10.0
LOOK_S: Final = 0.05


@dataclass(frozen=True)
class Cost:
    """Time and memory of a command.

    Attributes:
        time_s: Wall time [s].
        peak_mb: Peak resident memory of each of its processes, by name [MB].
    """

    time_s: float
    peak_mb: dict[str, float]

    @property
    def own_mb(self) -> float:
        """Peak of the command's own process [MB]."""
        return self.peak_mb["program"]


def run_and_measure(folder: Path, *arguments: str) -> Cost:
    """Run `rid-daq` in a folder; return its time and memory.

    Raises:
        CalledProcessError: It failed.
    """
    command = [sys.executable, "-m", "rid_daq", *arguments]
    peaks: dict[int, tuple[str, float]] = {}
    began_s = time.monotonic()
    with (
        (folder / "output.txt").open("wb") as output,
        subprocess.Popen(command, cwd=folder, stdout=output, stderr=output) as program,
    ):
        while program.poll() is None:
            for pid in (program.pid, *_descendants(program.pid)):
                seen = _peak(pid)
                if seen is not None:
                    peaks[pid] = seen
            time.sleep(LOOK_S)
    took_s = time.monotonic() - began_s
    if program.returncode:
        words = (folder / "output.txt").read_text()
        print(words, file=sys.stderr)
        raise subprocess.CalledProcessError(program.returncode, command)
    by_name: dict[str, float] = {}
    for pid, (name, peak_mb) in sorted(peaks.items()):
        key = "program" if pid == program.pid else name
        number = 2
        while key in by_name:
            key, number = f"{name} {number}", number + 1
        by_name[key] = peak_mb
    return Cost(took_s, by_name)


def _descendants(pid: int) -> list[int]:
    """Return the process ids of all descendants of a process."""
    found: list[int] = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        with contextlib.suppress(OSError):
            for child in map(int, task.read_text().split()):
                found += [child, *_descendants(child)]
    return found


def _peak(pid: int) -> tuple[str, float] | None:
    """Return a process's name and its peak resident memory [MB]; None if it has ended."""
    with contextlib.suppress(OSError):
        status = Path(f"/proc/{pid}/status").read_text()
        peak = re.search(r"^VmHWM:\s+(\d+) kB", status, re.MULTILINE)
        name = re.search(r"^Name:\s+(.*)$", status, re.MULTILINE)
        if peak and name:
            return name[1], int(peak[1]) / 1000.0
    return None


def record_motion(folder: Path, label: str, seconds: float) -> Cost:
    """Record the motion of the new cell for about `seconds`."""
    starter = (folder / "motion.yaml").read_text()
    periods = max(2, round(seconds / PERIOD_S))
    text, count = re.subn(r"(?m)^periods: \d+", f"periods: {periods}", starter)
    if count != 1:
        raise RuntimeError("the motion file of the new cell has no number of periods")
    (folder / f"{label}.yaml").write_text(text)
    return run_and_measure(folder, "record", "cell.yaml", f"{label}.yaml", "--label", label)


def main() -> int:
    """Measure, and print the figures; the last line is one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--long-s", type=float, default=3600.0)
    parser.add_argument("--short-s", type=float, default=360.0)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="rid-recording-") as name:
        folder = Path(name)
        run_and_measure(folder, "init", ".")
        short = record_motion(folder, "short", given.short_s)
        long = record_motion(folder, "long", given.long_s)
        reads = {
            command: run_and_measure(folder, command, "long").own_mb
            for command in ("average", "identify")
        }
    time_bar = TIME_BAR_PER_LENGTH * given.long_s / given.short_s
    time_ratio = long.time_s / short.time_s
    ratios = {
        name: peak_mb / short.peak_mb[name]
        for name, peak_mb in long.peak_mb.items()
        if name in short.peak_mb
    }
    print(f"{given.short_s:g} s of motion: {short.time_s:.1f} s")
    print(f"{given.long_s:g} s of motion: {long.time_s:.1f} s, {time_ratio:.2f} times as long")
    for name, ratio in ratios.items():
        print(
            f"  {name}: {short.peak_mb[name]:.0f} MB, {long.peak_mb[name]:.0f} MB,"
            f" {ratio:.3f} times"
        )
    for command, peak_mb in reads.items():
        print(f"{command} of the long run: {peak_mb:.0f} MB")
    holds = (
        time_ratio <= time_bar
        and max(ratios.values()) <= MEMORY_BAR
        and max(reads.values()) <= READ_BAR_MB
    )
    result = {
        "name": "recording",
        "value": round(time_ratio, 2),
        "unit": f"times the computing time for {given.long_s / given.short_s:g} times the motion",
        "ratios": {name: round(ratio, 3) for name, ratio in ratios.items()},
        "peak_mb": {command: round(peak_mb, 1) for command, peak_mb in reads.items()},
        "bar": f"time at most {time_bar:g} times, memory of every process {MEMORY_BAR:g} times,"
        f" average and identify at most {READ_BAR_MB:g} MB",
        "holds": holds,
    }
    print(json.dumps(result))
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
