"""Time and memory of identifying a six-axis arm with a coupled wrist from 45,000 samples.

`python -m benchmarks.identify [--quick] [--peer-python PYTHON]`. The time includes every step from
arrays of q, v, a, tau to an `Estimate` with covariances: base parameters, regressor, QR, weights,
residuals and intervals. Memory and time for 1, 2, 4 and 8 times the data are measured in separate
processes. `--peer-python` names a Python with figaroh, which identifies the same data.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the same value as in the program

import argparse
import json
import subprocess
import sys
import tempfile
import time
import tracemalloc
from pathlib import Path

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import FloatArray
from config.load import load_robot
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain
from dynamics.model.robot_model import RobotModel, torque
from identification.estimation.fitted_signals import fit_smoothed

SAMPLES = 45_000
STEP_S = 0.002
BAR_S = 0.5
PEER_RATIO = 10.0
MOST_TIME_GROWTH = 1.5
MOST_MEMORY_GROWTH = 1.5
PEER = Path(__file__).with_name("identify_peer.py")


def arm() -> RobotDescription:
    """Return a UR10e with a coupled wrist and five friction terms per joint."""
    robot = load_robot("ur10e")
    coupling = np.eye(6)
    coupling[4, 3], coupling[5, 3], coupling[5, 4] = 0.0125, -0.01, -0.02
    terms = ("coulomb", "viscous", "offset", "cube_root")
    joints = tuple(joint.model_copy(update={"friction": terms}) for joint in robot.joints)
    return robot.model_copy(
        update={"coupling": tuple(map(tuple, coupling.tolist())), "joints": joints}
    )


def recording(robot: RobotDescription, samples: int) -> SmoothedSignals:
    """Return a Fourier motion and its torques with noise."""
    random = np.random.default_rng(0)
    time_s: FloatArray = np.arange(samples, dtype=np.float64) * STEP_S
    omega = 2.0 * np.pi / 10.0 * np.arange(1, 9)
    sine, cosine = 0.3 * random.normal(size=(2, 8, 6))
    s, c = np.sin(np.outer(time_s, omega)), np.cos(np.outer(time_s, omega))
    q = s @ sine + c @ cosine
    v = (c * omega) @ sine - (s * omega) @ cosine
    a = -(s * omega**2) @ sine - (c * omega**2) @ cosine
    model = RobotModel.from_description(robot)
    tau = torque(model, q, v, a, random.normal(size=len(model.parameter_names)))
    return SmoothedSignals(
        joint_names=robot.joint_names,
        time_s=time_s,
        position=q,
        velocity=v,
        acceleration=a,
        torque_nm=tau + random.normal(size=tau.shape),
        segment=np.zeros(samples, dtype=np.int64),
        sample_period_s=STEP_S,
        cutoff_hz=10.0,
    )


def seconds(robot: RobotDescription, signals: SmoothedSignals, rounds: int) -> float:
    """Return the shortest time of some rounds [s], without the first round, which compiles."""
    fit_smoothed(robot, [signals]).estimate()
    times = []
    for _ in range(rounds):
        began_s = time.perf_counter()
        fit_smoothed(robot, [signals]).estimate()
        times.append(time.perf_counter() - began_s)
    return min(times)


def cost_in_process(times: int) -> tuple[float, float]:
    """Return time [s] and additional memory [MB] for `times` the data, in a separate process."""
    command = [sys.executable, "-m", "benchmarks.identify", "--one", str(times)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    spent_s, memory_mb = done.stdout.split()
    return float(spent_s), float(memory_mb)


def print_cost(times: int) -> None:
    """Measure time and memory for `times` the data in this process, and print them."""
    robot = arm()
    signals = recording(robot, SAMPLES * times)
    fit_smoothed(robot, [recording(robot, 5000)]).estimate()
    began_s = time.perf_counter()
    fit_smoothed(robot, [signals]).estimate()
    spent_s = time.perf_counter() - began_s
    tracemalloc.start()
    fit_smoothed(robot, [signals]).estimate()
    print(spent_s, tracemalloc.get_traced_memory()[1] / 2**20)


def peer_seconds(python: str, signals: SmoothedSignals) -> float | None:
    """Return the time of figaroh for the same arrays [s], or None if it cannot run."""
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder, "data.npz")
        arrays = {
            "q": signals.position,
            "v": signals.velocity,
            "a": signals.acceleration,
            "tau": signals.torque_nm,
            "rows": Chain.from_description(arm()).rows,
        }
        np.savez(data, allow_pickle=False, **arrays)
        done = subprocess.run(
            [python, str(PEER), str(data)], check=False, capture_output=True, text=True
        )
    if done.returncode != 0:
        reason = done.stderr.strip().splitlines() or ["no message"]
        print(f"figaroh cannot run in {python}: {reason[-1]}")
        return None
    print(f"figaroh: {done.stdout.strip()}")
    return float(done.stdout.split()[0])


def main() -> int:
    """Measure, and print the figures; the last line is one JSON object."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.identify")
    parser.add_argument("--quick", action="store_true", help="fewer rounds, up to 4 times the data")
    parser.add_argument("--peer-python", metavar="PYTHON", help="a Python that has figaroh")
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print_cost(options.one)
        return 0
    robot = arm()
    signals = recording(robot, SAMPLES)
    value = seconds(robot, signals, 2 if options.quick else 5)
    estimate = fit_smoothed(robot, [signals]).estimate()
    print(f"{SAMPLES} samples, {len(estimate.base)} base parameters: {value:.3f} s")
    rows = [(k, *cost_in_process(k)) for k in ((1, 2, 4) if options.quick else (1, 2, 4, 8))]
    for k, spent_s, memory_mb in rows:
        print(f"{k} times the data: {spent_s:.3f} s, {memory_mb:.0f} MB at most beyond the data")
    time_growth = rows[-1][1] / rows[0][1] / rows[-1][0]
    memory_growth = rows[-1][2] / max(rows[0][2], 1.0)
    ratios = {"time per sample, largest over smallest amount of data": round(time_growth, 2)}
    ratios["memory, largest over smallest amount of data"] = round(memory_growth, 2)
    holds = value <= BAR_S and len(estimate.base) >= 60
    holds &= time_growth <= MOST_TIME_GROWTH and memory_growth <= MOST_MEMORY_GROWTH
    if options.peer_python:
        peer = peer_seconds(options.peer_python, signals)
        if peer is not None:
            ratios["figaroh"] = round(peer / value, 1)
            holds &= peer / value >= PEER_RATIO
    print(
        json.dumps(
            {
                "name": "identify",
                "value": round(value, 3),
                "unit": "s",
                "ratios": ratios,
                "bar": f"at most {BAR_S} s with 60 parameters or more; time linear and memory flat"
                f" (growth at most {MOST_TIME_GROWTH}); figaroh, where given, {PEER_RATIO:g} times",
                "holds": bool(holds),
            }
        )
    )
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
