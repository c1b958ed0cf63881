"""Hours of simulated motion in lock-step with a fault every minute: `python -m benchmarks.soak`.

The same simulated cell and program run for the whole time. Every simulated minute a fault occurs on
the bus, in a drive, in a process of the program or by the operator. Requirements:
- After each fault the reaction is correct, the axes are at rest and the recording is readable.
- After a reset of the faulty drives, the next motion runs normally.
- Memory of program, hub and drives grows by at most 1 % an hour (in less than half an hour: by 5 %
  in all), and they have no more descriptors than after the warm-up.

`--hours H` sets the simulated time (default: 8), `--every S` the time between faults (default: 60
s). `--quick` makes each of a few faults once.
"""

from __future__ import annotations

import argparse
import contextlib
import gc
import json
import math
import multiprocessing
import os
import random
import shutil
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from acquisition.journal.cycles import read_journal
from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.runs.folder import RunFolder
from acquisition.session.outcome import RecordOutcome
from acquisition.session.record import record_motion
from benchmarks.soak_faults import FAULTS, QUICK, Fault
from config.errors import RidDaqError
from config.load import LoadedCell, load_cell
from config.simulation.faults import FaultScript
from drivers.cell import open_cell
from mock_hw.cell import SimulatedCell
from mock_hw.simulation import CellSimulation

GROWTH_BAR_PERCENT_PER_H: Final = 1.0
GROWTH_BAR_QUICK_PERCENT: Final = 5.0
WARM_UP: Final = 3
PERIOD_S: Final = 2.0
RAMP_S: Final = 1.0
AFTER_S: Final = 3.0  # duration of the motion after the fault
LEAST_S: Final = 6.0  # time from the start of a motion to the fault
REST_PATIENCE_S: Final = 60.0


@dataclass
class Soak:
    """Results of a soak test.

    Attributes:
        wrong: Messages about wrong reactions.
        faults, rows: Numbers of faults and of recorded rows.
        hours: Simulated time after each fault [h].
        memory_b, descriptors: Memory [bytes] and descriptors of each process after each fault, by
            the process's name.
    """

    wrong: list[str] = field(default_factory=list)
    faults: int = 0
    rows: int = 0
    hours: list[float] = field(default_factory=list)
    memory_b: list[dict[str, int]] = field(default_factory=list)
    descriptors: list[dict[str, int]] = field(default_factory=list)

    def measure(self, time_s: float) -> None:
        """Add the memory and descriptors of the processes."""
        gc.collect()
        processes = {"program": os.getpid()}
        for process in multiprocessing.active_children():
            if process.pid is not None:
                processes[process.name] = process.pid
        self.hours.append(time_s / 3600.0)
        self.memory_b.append({name: _memory_b(pid) for name, pid in processes.items()})
        self.descriptors.append({name: _descriptors(pid) for name, pid in processes.items()})

    @property
    def _settled(self) -> int:
        return min(WARM_UP, len(self.hours) // 2)

    def growth(self) -> dict[str, tuple[float, float]]:
        """Return each process's memory growth after the warm-up: percent per hour, and in total."""
        found = {}
        hours = np.array(self.hours[self._settled :])
        for name in self.memory_b[-1]:
            held = np.array([each[name] for each in self.memory_b[self._settled :]], dtype=float)
            slope = float(np.polyfit(hours, held, 1)[0]) if len(hours) > 2 else 0.0
            whole = 100.0 * (float(held[-1]) - float(held[0])) / float(held[0])
            found[name] = (100.0 * slope / float(held[0]), whole)
        return found

    def leaks(self) -> dict[str, int]:
        """Return the increase of each process's descriptors after the warm-up."""
        first, last = self.descriptors[self._settled], self.descriptors[-1]
        return {name: last[name] - first.get(name, 0) for name in last}


def soak(
    hours: float,
    every_s: float,
    seed: int,
    folder: Path,
    say: Callable[[str], None] = lambda _text: None,
    faults: tuple[Fault, ...] = FAULTS,
) -> Soak:
    """Run a soak test.

    Args:
        hours, every_s: Simulated time, and time between two faults [h, s].
        seed: Seed of the noise and of the order of the faults.
        folder: Parent of the run folders; each is removed after its check.
        say: Function that prints a line for every fault.
        faults: Faults to use; all occur about equally often.
    """
    loaded = load_cell("ir361")
    plan = _plan(faults, round(hours * 3600.0 / every_s), seed)
    times_s = [every_s * (number + 1) for number in range(len(plan))]
    found = Soak()
    if loaded.plant is None:
        raise RuntimeError("the bundled cell has a plant")
    with SimulatedCell(
        CellSimulation(
            loaded.config,
            loaded.robot,
            loaded.plant,
            realtime=False,
            seed=seed,
            faults=_script(plan, times_s, seed),
        )
    ) as cell:
        for fault, at_s in zip(plan, times_s, strict=True):
            begun_s = time.monotonic()
            problem, rows = _live_through(cell, loaded, fault, at_s, folder)
            found.faults += 1
            found.rows += rows
            if problem:
                found.wrong.append(f"{at_s:.0f} s: {fault.name}: {problem}")
            found.measure(cell.axes().time_s)
            took_s = time.monotonic() - begun_s
            say(f"{at_s:7.0f} s  {fault.name}: {problem or 'right'}  ({rows} rows, {took_s:.1f} s)")
    return found


def _plan(faults: tuple[Fault, ...], count: int, seed: int) -> list[Fault]:
    """Return faults in random order; each fault is used once before any is repeated."""
    shuffled = random.Random(seed)
    order: list[Fault] = []
    while len(order) < count:
        order += shuffled.sample(faults, len(faults))
    return order[:count]


def _script(plan: list[Fault], times_s: list[float], seed: int) -> FaultScript:
    parts: dict[str, list[dict[str, Any]]] = {"bus": [], "drives": [], "program": []}
    for fault, at_s in zip(plan, times_s, strict=True):
        parts[fault.part].append({**fault.keys, "at_s": at_s})
    lists = {part: tuple(faults) for part, faults in parts.items()}
    return FaultScript.model_validate({"seed": seed, **lists})


def _live_through(
    cell: SimulatedCell, loaded: LoadedCell, fault: Fault, at_s: float, folder: Path
) -> tuple[str, int]:
    """Run a motion with a fault; return an error message, if any, and the number of rows."""
    left_s = at_s - cell.axes().time_s
    if left_s < LEAST_S:
        return f"only {left_s:.1f} s of motion before the fault: the faults are too close", 0
    motion = _motion(loaded, left_s + AFTER_S)
    samples = motion.plan(loaded.robot, loaded.config.cycle_time_s)
    run = RunFolder.create(folder, "soak")
    try:
        outcome = record_motion(cell.cell, loaded.robot, samples, run)
        if outcome.interrupted_by is not None and fault.keys["kind"] != "signal":
            raise SystemExit(128 + outcome.interrupted_by)
        return _judge(fault, outcome, cell) or _reset(cell, loaded), outcome.rows
    except RidDaqError as error:
        return f"{type(error).__name__}: {error}", 0
    finally:
        shutil.rmtree(run.path)


def _motion(loaded: LoadedCell, duration_s: float) -> FourierMotion:
    joints = tuple(
        FourierJoint(joint=name, offset=offset, sine=(0.2,), cosine=(0.1,))
        for name, offset in zip(loaded.robot.joint_names, (0.1, -0.15, 0.2), strict=True)
    )
    return FourierMotion(
        kind="fourier",
        robot=loaded.robot.name,
        period_s=PERIOD_S,
        periods=math.ceil((duration_s - PERIOD_S - 2.0 * RAMP_S) / PERIOD_S),
        ramp_s=RAMP_S,
        joints=joints,
    )


def _judge(fault: Fault, outcome: RecordOutcome, cell: SimulatedCell) -> str:
    """Return the error in a reaction; empty if the reaction is correct."""
    stop = None if outcome.stop is None else outcome.stop.code
    if stop is None and fault.stops:
        return "the motion continued after the fault"
    if stop is not None and stop not in fault.stops:
        return f"stopped by {stop.name}: {outcome.stop.text if outcome.stop else ''}"
    if not _comes_to_rest(cell):
        return "an axis still moves, or still has power"
    journal = read_journal(outcome.path)
    if not fault.tears_the_file and journal.damage.notes:
        return "; ".join(journal.damage.notes)
    if (np.diff(journal.rows["cycle"].astype(np.int64)) != 1).any():
        return "rows are missing in the recording"
    return ""


def _reset(cell: SimulatedCell, loaded: LoadedCell) -> str:
    """Reset the drives' faults; return a message about drives that stay in fault."""
    with open_cell(cell.cell, loaded.robot) as opened:
        drives = opened.axes.service.reset_faults()
    left = [drive.joint for drive in drives if drive.is_faulty or drive.refusal]
    return f"{', '.join(left)} cannot be reset" if left else ""


def _comes_to_rest(cell: SimulatedCell) -> bool:
    """Wait until no axis moves or has power; return False after a timeout."""
    until_s = time.monotonic() + REST_PATIENCE_S
    while time.monotonic() < until_s:
        axes = cell.axes()
        if not axes.enabled.any() and float(np.abs(axes.velocity).max()) < 1e-6:
            return True
        os.sched_yield()
    return False


def _memory_b(pid: int) -> int:
    """Return a process's resident memory [bytes]."""
    with contextlib.suppress(OSError):
        for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines():
            if line.startswith("Rss:"):
                return 1024 * int(line.split()[1])
    return 0


def _descriptors(pid: int) -> int:
    with contextlib.suppress(OSError):
        return len(os.listdir(f"/proc/{pid}/fd"))
    return 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=8.0)
    parser.add_argument("--every", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--quick", action="store_true")
    return parser.parse_args()


def _say(text: str) -> None:
    print(text, flush=True)


def main() -> int:
    """Measure, and print the figures; the last line is one JSON object."""
    options = _arguments()
    hours, every_s = options.hours, options.every
    faults: tuple[Fault, ...] = FAULTS
    if options.quick:
        every_s, faults = 20.0, QUICK
        hours = len(QUICK) * every_s / 3600.0
    with TemporaryDirectory(prefix="rid-soak-") as folder:
        found = soak(hours, every_s, options.seed, Path(folder), _say, faults)
    growth, leaks = found.growth(), found.leaks()
    for name, (per_hour, whole) in growth.items():
        print(f"{name}: memory {whole:+.2f} % in all, {per_hour:+.2f} % an hour")
    long_enough = hours >= 0.5
    worst = max(each[0] if long_enough else each[1] for each in growth.values())
    bar = GROWTH_BAR_PERCENT_PER_H if long_enough else GROWTH_BAR_QUICK_PERCENT
    holds = not found.wrong and worst <= bar and not any(count > 0 for count in leaks.values())
    result = {
        "name": "soak",
        "value": round(worst, 3),
        "unit": "% memory growth per simulated hour" if long_enough else "% memory growth in all",
        "ratios": {},
        "simulated_h": round(found.hours[-1], 3),
        "faults": found.faults,
        "wrong_reactions": len(found.wrong),
        "rows": found.rows,
        "descriptors_leaked": leaks,
        "bar": f"every reaction right, memory growth at most {bar:g} %"
        f"{' an hour' if long_enough else ' in all'}, no more descriptors than after the warm-up",
        "holds": holds,
    }
    print(json.dumps(result))
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
