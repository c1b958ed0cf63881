"""Accuracy of 30 payload sessions on the simulated six-axis cell.

`python -m benchmarks.payload_sessions [--quick] [--jobs N]`. Each session is an unattended
`rid-daq payload kr15` on the simulated buses, with a different seed for motion and cell: cold
motors, preflight, rehearsal, warm-up, a run without payload and a run with payload. Each of the
three reference payloads has ten sessions.

Requirements:
- The verdict of each session passes; the mass is within 40 g, the centre of gravity within 2 mm.
- At least 90 % of the true values are inside two cluster-robust standard deviations.
- The standard deviation of the results of several sessions is 0.7 to 1.4 times the reported one.

`--quick` runs one short session and checks its intervals only. `--jobs 2` runs two sessions in
parallel.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import json
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from config.arrays import FloatArray
from config.load import load_cell

PAYLOADS = ("small", "medium", "large")
SESSIONS = 10
MASS_KG = 0.040
CENTRE_M = 0.002
HELD_SHARE = 0.90
LOW, HIGH = 0.7, 1.4
SHORT = ("--periods", "4", "--rehearsal", "0", "--warm-up", "50", "--warm-up-periods", "3")


@dataclass(frozen=True)
class Session:
    """One session: errors of the ten parameters, and reported standard deviations, (10,) each."""

    payload: str
    seed: int
    off: FloatArray
    sigma: FloatArray
    passed: bool
    elapsed_s: float

    @property
    def accurate(self) -> bool:
        """True if mass and centre of gravity are within their limits."""
        return bool(abs(self.off[0]) <= MASS_KG and np.abs(self.off[1:4]).max() <= CENTRE_M)


def session(payload: str, seed: int, short: bool) -> Session:
    """Run one session in a separate process, with its buses in a separate folder."""
    with tempfile.TemporaryDirectory(prefix="pls") as place:
        runtime = Path(place) / "x"
        runtime.mkdir(mode=0o700)
        words = [
            sys.executable, "-m", "rid_daq", "payload", "kr15", "--payload", payload,
            "--seed", str(seed), "--yes", "--json", "--runs", str(Path(place) / "runs"),
            *(SHORT if short else ()),
        ]  # fmt: skip
        began_s = time.monotonic()
        done = subprocess.run(
            words,
            capture_output=True,
            text=True,
            env={**os.environ, "XDG_RUNTIME_DIR": str(runtime)},
            check=False,
        )
    if done.returncode not in (0, 1):
        raise SystemExit(f"session {payload}, seed {seed}: exit {done.returncode}\n{done.stderr}")
    document = json.loads(done.stdout)
    plant = load_cell("kr15").plant
    assert plant is not None
    body = plant.payloads[payload]
    truth = np.array([body.mass_kg, *body.centre_m, *body.inertia_kg_m2])
    found = document["payload"]["parameters"]
    return Session(
        payload=payload,
        seed=seed,
        off=np.array([entry["value"] for entry in found]) - truth,
        sigma=np.array([entry["std"] for entry in found]),
        passed=bool(document["verdict"]["passed"]),
        elapsed_s=time.monotonic() - began_s,
    )


def scatter_ratio(sessions: list[Session]) -> float:
    """Return the scatter between sessions, divided by the reported standard deviation."""
    squares, freedom = 0.0, 0
    for payload in {each.payload for each in sessions}:
        own = [each for each in sessions if each.payload == payload]
        off, sigma = np.array([each.off for each in own]), np.array([each.sigma for each in own])
        squares += float(np.sum(((off - off.mean(axis=0)) / sigma) ** 2))
        freedom += (len(own) - 1) * off.shape[1]
    return float(np.sqrt(squares / max(freedom, 1)))


def main() -> int:
    """Measure, and print the figures; the last line is one JSON object."""
    quick = "--quick" in sys.argv
    jobs = int(sys.argv[sys.argv.index("--jobs") + 1]) if "--jobs" in sys.argv else 1
    count = 1 if quick else SESSIONS
    names = ("medium",) if quick else PAYLOADS
    pairs = [(name, 100 * k + seed) for k, name in enumerate(names) for seed in range(count)]
    sessions: list[Session] = []
    with ThreadPoolExecutor(jobs) as pool:
        for each in pool.map(lambda pair: session(pair[0], pair[1], quick), pairs):
            sessions.append(each)
            centre = ", ".join(f"{1e3 * value:+.2f}" for value in each.off[1:4])
            print(
                f"{each.payload:7}seed {each.seed:4}: {1e3 * each.off[0]:+6.1f} g, ({centre}) mm,"
                f" {np.sum(np.abs(each.off) <= 2.0 * each.sigma)} of 10 inside,"
                f" {'passed' if each.passed else 'FAILED'}, {each.elapsed_s:.0f} s",
                flush=True,
            )
    held = float(np.mean([np.abs(each.off) <= 2.0 * each.sigma for each in sessions]))
    accurate = sum(each.accurate for each in sessions)
    ratio = scatter_ratio(sessions) if len(sessions) > len(names) else None
    worst_g = 1e3 * max(abs(float(each.off[0])) for each in sessions)
    worst_mm = 1e3 * max(float(np.abs(each.off[1:4]).max()) for each in sessions)
    print(f"{accurate} of {len(sessions)} within 40 g and 2 mm; worst {worst_g:.0f} g, ", end="")
    print(f"{worst_mm:.2f} mm; {100 * held:.0f} % of the truth within two standard deviations")
    holds = held >= HELD_SHARE
    if not quick:
        holds = holds and accurate == len(sessions) and ratio is not None and LOW <= ratio <= HIGH
        holds = holds and all(each.passed for each in sessions)
    print(
        json.dumps(
            {
                "name": "payload_sessions",
                "value": round(worst_mm, 2),
                "unit": "mm, worst coordinate of a centre of gravity",
                "ratios": {
                    "scatter over quoted": None if ratio is None else round(ratio, 2),
                    "worst mass over 40 g": round(worst_g / (1e3 * MASS_KG), 2),
                    "true values inside two sigma": round(held, 3),
                },
                "bar": "truth inside in 90 %"
                if quick
                else "40 g, 2 mm, truth inside in 90 %, scatter 0.7 to 1.4 of reported, all passed",
                "holds": holds,
            }
        )
    )
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
