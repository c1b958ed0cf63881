"""Time and memory of `import` and `identify` for recordings of up to ten million rows of six axes.

`python -m benchmarks.rows [--quick | --long] [--peer-python PYTHON]` writes CSV files with 100,000
and 1,000,000 rows (`--quick`: 20,000 and 200,000; `--long`: also 10,000,000) and runs the whole
commands on them, each in its own process. For comparison, pandas and pyarrow parse the same file,
and figaroh identifies the same rows if `--peer-python` names a Python with figaroh.

The processor time of a process and of its children is compared, because other load on the computer
affects it less than the wall time. The time limits hold for a computer on which pandas needs
`PANDAS_S` per million rows, and are scaled by its time in the same run. The last line is one JSON
object. The exit code is 1 if a limit does not hold.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
import pyarrow
from pyarrow import csv

from acquisition.runs.manifest import RECORDING
from benchmarks.simulated_arm import SimulatedArm
from config.arrays import FloatArray
from config.load import to_yaml
from dynamics.geometry.kinematics import Chain

JOINTS: Final = 6
STEP_S: Final = 0.002
PERIOD_ROWS: Final = 5000
PIECE_ROWS: Final = 40 * PERIOD_ROWS
ENCODER_RAD: Final = 2e-6
VELOCITY_RAD_S: Final = 1e-4
TORQUE_SHARE: Final = 0.01
"""Noise of the torque, relative to its RMS."""

PANDAS_S: Final = 1.3
"""Processor time of pandas per million rows on the idle computer on which the limits were set."""
BARS_S: Final = {"import": 2.0, "identify": 6.0}
BAR_MB: Final = 400.0
MOST_GROWTH: Final = 1.1
FIGAROH_ROWS: Final = 45_000
"""Largest number of rows for figaroh, which keeps several copies of the regressor in memory."""

PEERS: Final = {
    "pandas": "import sys, pandas; pandas.read_csv(sys.argv[1])",
    "pyarrow": "import sys; from pyarrow import csv; csv.read_csv(sys.argv[1])",
}
LAUNCHER: Final = """\
import os, sys
os.dup2(1, 2)
child = os.posix_spawn(sys.argv[1], sys.argv[1:], os.environ)
_, status, usage = os.wait4(child, 0)
code, used_s = os.waitstatus_to_exitcode(status), usage.ru_utime + usage.ru_stime
print("\\n", code, used_s, usage.ru_maxrss, end="")
"""
"""A small program that runs a command: a child's peak memory begins with that of its parent."""
FIGAROH: Final = Path(__file__).with_name("identify_peer.py")


@dataclass(frozen=True)
class Cost:
    """Cost of a process.

    Attributes:
        processor_s: Processor time of the process and its children [s].
        peak_mb: Largest resident memory of one of them [MB].
    """

    processor_s: float
    peak_mb: float

    @classmethod
    def of(cls, command: Sequence[str], codes: Sequence[int] = (0,)) -> Cost:
        """Run a command.

        Raises:
            SystemExit: Its exit code is not among `codes`.
        """
        launcher = (sys.executable, "-S", "-c", LAUNCHER, *command)
        done = subprocess.run(launcher, check=True, stdout=subprocess.PIPE)
        output, _, usage = done.stdout.decode(errors="replace").rpartition("\n")
        code, processor_s, peak = usage.split()
        if int(code) not in codes:
            print(output, file=sys.stderr)
            raise SystemExit(f"{' '.join(command[:5])}: exit code {code}")
        return cls(float(processor_s), int(peak) * (1e-6 if sys.platform == "darwin" else 1.024e-3))


@dataclass(frozen=True, eq=False)
class Period:
    """One period of a Fourier motion of an arm, with its torques by Pinocchio.

    Attributes:
        position, velocity, acceleration, torque: Shape (rows, joints).
    """

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    torque: FloatArray

    @classmethod
    def of(cls, arm: SimulatedArm) -> Period:
        """Return a period in which all joints move."""
        random = np.random.default_rng(0)
        time_s = STEP_S * np.arange(PERIOD_ROWS)
        omega = 2.0 * np.pi / (STEP_S * PERIOD_ROWS) * np.arange(1, 9)
        sine, cosine = 0.15 * random.normal(size=(2, 8, JOINTS))
        s, c = np.sin(np.outer(time_s, omega)), np.cos(np.outer(time_s, omega))
        q, v = s @ sine + c @ cosine, (c * omega) @ sine - (s * omega) @ cosine
        a = -(s * omega**2) @ sine - (c * omega**2) @ cosine
        data = arm.model.createData()
        rigid = [pin.rnea(arm.model, data, *row).copy() for row in zip(q, v, a, strict=True)]
        rotor = arm.rotor * a + arm.coulomb * np.sign(v) + arm.viscous * v
        return cls(q, v, a, np.array(rigid) + rotor)

    def rows(self, first: int, count: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return rows as a logger measures them: times, positions, velocities and torques."""
        random = np.random.default_rng(first)
        at = np.arange(first, first + count)
        noise: FloatArray = random.normal(size=(3, count, JOINTS))
        power = np.square(self.torque).mean(axis=0)
        levels = np.asarray(TORQUE_SHARE * np.sqrt(power), dtype=np.float64)
        at_period = at % PERIOD_ROWS
        time_s = np.asarray(STEP_S * at, dtype=np.float64)
        return (
            time_s,
            self.position[at_period] + ENCODER_RAD * noise[0],
            self.velocity[at_period] + VELOCITY_RAD_S * noise[1],
            self.torque[at_period] + levels * noise[2],
        )


def write_recording(path: Path, period: Period, rows: int) -> None:
    """Write a CSV file with a header, times, positions, velocities and torques."""
    names = ["time"]
    names += [f"{what}{joint}" for what in ("q", "v", "tau") for joint in range(1, JOINTS + 1)]
    schema = pyarrow.schema([(name, pyarrow.float64()) for name in names])
    with csv.CSVWriter(path, schema) as writer:
        for first in range(0, rows, PIECE_ROWS):
            count = min(PIECE_ROWS, rows - first)
            columns = np.column_stack(period.rows(first, count)).round(7)
            writer.write_table(pyarrow.table(list(np.ascontiguousarray(columns.T)), schema))


def write_map(folder: Path, arm: SimulatedArm) -> Path:
    """Write the arm and an import map of the recordings."""
    (folder / "arm.yaml").write_text(to_yaml(arm.robot))
    joints = [
        {
            "joint": joint.name,
            "position": f"q{number}",
            "velocity": f"v{number}",
            "torque": f"tau{number}",
        }
        for number, joint in enumerate(arm.robot.joints, start=1)
    ]
    content = {
        "name": "rows",
        "robot": "arm.yaml",
        "header_rows": 1,
        "time": {"column": "time", "unit": "s"},
        "side": "link",
        "units": {"position": "rad", "velocity": "rad/s", "torque": "Nm"},
        "plausible": {"position": 7.0, "speed": 30.0, "torque": 5000.0},
        "torques": "motor_torque",
        "joints": joints,
    }
    path = folder / "map.yaml"
    path.write_text(json.dumps(content))
    return path


def measure(folder: Path, period: Period, map_file: Path, rows: int) -> dict[str, Cost]:
    """Return the costs of both commands and of the peers for a recording of some rows."""
    source, runs = folder / f"{rows}.csv", folder / f"runs-{rows}"
    write_recording(source, period, rows)
    program = (sys.executable, "-m", "rid_daq")
    place = ("--runs", str(runs))
    costs = {
        name: Cost.of((sys.executable, "-c", text, str(source))) for name, text in PEERS.items()
    }
    costs["import"] = Cost.of((*program, "import", str(source), "--map", str(map_file), *place))
    source.unlink()
    (run,) = (path.parent for path in runs.rglob(RECORDING))
    costs["identify"] = Cost.of((*program, "identify", str(run), *place), codes=(0, 6))
    for what, cost in costs.items():
        print(
            f"{rows} rows, {what}: {cost.processor_s:.2f} s,"
            f" {1e6 * cost.processor_s / rows:.2f} s per million rows, {cost.peak_mb:.0f} MB",
            flush=True,
        )
    return costs


def figaroh_s(python: str, arm: SimulatedArm, period: Period) -> float | None:
    """Return the time of figaroh per million rows [s], or None if it cannot run."""
    times = np.arange(FIGAROH_ROWS) % PERIOD_ROWS
    with tempfile.TemporaryDirectory(prefix="rid-rows-") as name:
        data = Path(name, "data.npz")
        np.savez(
            data,
            allow_pickle=False,
            q=period.position[times],
            v=period.velocity[times],
            a=period.acceleration[times],
            tau=period.torque[times],
            rows=Chain.from_description(arm.robot).rows,
        )
        done = subprocess.run(
            [python, str(FIGAROH), str(data)], check=False, capture_output=True, text=True
        )
    if done.returncode != 0:
        reason = done.stderr.strip().splitlines() or ["no message"]
        print(f"figaroh cannot run in {python}: {reason[-1]}")
        return None
    print(f"{FIGAROH_ROWS} rows, figaroh, without reading a file: {done.stdout.strip()}")
    return float(done.stdout.split()[0]) * 1e6 / FIGAROH_ROWS


def main() -> int:
    """Measure, and print the figures; the last line is one JSON object."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.rows")
    parser.add_argument("--quick", action="store_true", help="20,000 and 200,000 rows")
    parser.add_argument("--long", action="store_true", help="also 10,000,000 rows")
    parser.add_argument("--peer-python", metavar="PYTHON", help="a Python that has figaroh")
    options = parser.parse_args()
    sizes: tuple[int, ...] = (20_000, 200_000) if options.quick else (100_000, 1_000_000)
    sizes = (*sizes, 10_000_000) if options.long else sizes
    print(f"{os.cpu_count()} processors, load {os.getloadavg()[0]:.1f} at the beginning")
    arm = SimulatedArm.of("six")
    period = Period.of(arm)
    with tempfile.TemporaryDirectory(prefix="rid-rows-") as name:
        folder = Path(name)
        map_file = write_map(folder, arm)
        costs: dict[int, dict[str, Cost]] = {}
        bars: dict[str, bool] = {}
        for rows in sizes:
            try:
                costs[rows] = measure(folder, period, map_file, rows)
            except SystemExit as refused:
                if not costs:
                    raise
                print(refused)
                bars[f"{rows} rows"] = False
                break
    sizes = tuple(costs)
    slope = {
        what: [1e6 * costs[rows][what].processor_s / rows for rows in sizes]
        for what in costs[sizes[0]]
    }
    slowdown = max(slope["pandas"][-1] / PANDAS_S, 1.0)
    ratios = {f"{what} over pandas": slope[what][-1] / slope["pandas"][-1] for what in BARS_S}
    if options.peer_python:
        peer_s = figaroh_s(options.peer_python, arm, period)
        if peer_s is not None:
            ratios["figaroh over identify"] = peer_s / slope["identify"][-1]
    else:
        print("figaroh was not measured: --peer-python names no Python that has it")
    for what, bar_s in BARS_S.items():
        growth = max(
            (after / before for before, after in zip(slope[what], slope[what][1:], strict=False)),
            default=1.0,
        )
        peak_mb = max(costs[rows][what].peak_mb for rows in sizes)
        bars[f"time of {what}"] = slope[what][-1] <= bar_s * slowdown
        bars[f"memory of {what}"] = peak_mb <= BAR_MB
        bars[f"growth of {what}"] = growth <= MOST_GROWTH
        print(
            f"{what}: {slope[what][-1]:.2f} s per million rows (at most {bar_s * slowdown:.2f}),"
            f" {peak_mb:.0f} MB (at most {BAR_MB:g}), {growth:.2f} times per decade"
            f" (at most {MOST_GROWTH:g})"
        )
    holds = all(bars.values())
    print(
        json.dumps(
            {
                "name": "rows",
                "value": round(slope["import"][-1], 2),
                "unit": "s of processor time per million rows of six axes, import",
                "identify_s": round(slope["identify"][-1], 2),
                "peak_mb": {
                    what: round(max(costs[rows][what].peak_mb for rows in sizes)) for what in BARS_S
                },
                "ratios": {what: round(ratio, 2) for what, ratio in ratios.items()},
                "bar": f"per million rows import {BARS_S['import']:g} s and identify"
                f" {BARS_S['identify']:g} s if pandas takes {PANDAS_S:g} s; {BAR_MB:g} MB;"
                f" growth per decade {MOST_GROWTH:g}",
                "failed": [bar for bar, held in bars.items() if not held],
                "holds": holds,
            }
        )
    )
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
