"""Coverage of confidence intervals with an incomplete model, in 200 simulated experiments.

`python -m benchmarks.coverage [--quick]`. A three-axis arm runs a periodic excitation. Every
experiment (`--quick`: 50 of them) has its own random white noise and model errors. The model errors
repeat in each period, so that averaging does not remove them: ripple over the joint angle (gears,
motors) with random wave numbers, and coloured torque with a first-order spectrum. The
cluster-robust interval of two standard deviations (nominal 95.4 %) must contain the true value in
90 to 98 % of the cases.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import json
import sys
from dataclasses import dataclass

import numpy as np

from acquisition.processing.periods import PeriodAverage
from benchmarks.short_form import is_short
from config.arrays import FloatArray
from config.load import load_robot
from dynamics.model.robot_model import RobotModel, regressor
from identification.design.two_harmonic import TwoHarmonicOptions, design_two_harmonic
from identification.estimation.fitted_periods import fit_periodic
from identification.model.base_parameters import base_parameters

CYCLE_S = 0.008
PERIOD_S = 10.0
PERIODS = 16
OVERSAMPLING = 8
NOISE_NM = 1.0
RIPPLE_NM = 0.6
RIPPLES = 3
COLOURED_NM = 0.8
CORNER_HZ = 0.8
LOW, HIGH = 0.90, 0.98


@dataclass(frozen=True)
class Coverage:
    """Fractions of base parameters whose true value lies within two standard deviations."""

    clustered: float
    white: float
    noise: float


def coverage(experiments: int) -> Coverage:
    """Simulate and identify experiments; return how often the intervals contain the true value."""
    robot = load_robot("ir361")
    motion = design_two_harmonic(robot, TwoHarmonicOptions(PERIOD_S, tries=50), CYCLE_S)
    trajectory = motion.trajectory(robot, CYCLE_S)
    samples = round(PERIOD_S / CYCLE_S)
    times = np.arange(samples * OVERSAMPLING) * CYCLE_S / OVERSAMPLING
    q, v, a = (
        f(times) for f in (trajectory.position, trajectory.velocity, trajectory.acceleration)
    )
    model = RobotModel.from_description(robot)
    base = base_parameters(model)
    truth = np.random.default_rng(0).normal(size=len(base))
    spectrum = np.fft.rfft(base.columns(regressor(model, q, v, a)) @ truth, axis=0)
    torque = np.fft.irfft(spectrum[: samples // 2 + 1] / OVERSAMPLING, samples, axis=0)
    position = q[::OVERSAMPLING]
    held = []
    for seed in range(experiments):
        random = np.random.default_rng(seed + 1)
        error = _ripple(position, random) + _draw_coloured_noise(position.shape, random)
        noise = NOISE_NM / np.sqrt(PERIODS) * random.normal(size=position.shape)
        estimate = fit_periodic(robot, [_average(position, torque + error + noise)]).estimate()
        miss = np.abs(estimate.values - truth)
        sigmas = (estimate.sigma, estimate.sigma_residual, estimate.sigma_noise)
        held.append([miss < 2.0 * np.asarray(sigma) for sigma in sigmas])
    return Coverage(*(float(share) for share in np.mean(held, axis=(0, 2))))


def _ripple(position: FloatArray, random: np.random.Generator) -> FloatArray:
    shape = (RIPPLES, 1, position.shape[1])
    waves, phase = random.uniform(5.0, 40.0, shape), random.uniform(0.0, 2.0 * np.pi, shape)
    size = RIPPLE_NM * random.normal(size=shape)
    return np.asarray(np.sum(size * np.sin(waves * position + phase), axis=0))


def _draw_coloured_noise(shape: tuple[int, ...], random: np.random.Generator) -> FloatArray:
    samples, joints = shape
    frequency_hz = np.arange(samples // 2 + 1) / PERIOD_S
    bins = random.normal(size=(2, len(frequency_hz), joints))
    colour = 1.0 / np.sqrt(1.0 + (frequency_hz / CORNER_HZ) ** 2)
    colour[0] = 0.0
    signal = np.fft.irfft((bins[0] + 1j * bins[1]) * colour[:, np.newaxis], samples, axis=0)
    return np.asarray(COLOURED_NM * signal / signal.std(axis=0))


def _average(position: FloatArray, torque: FloatArray) -> PeriodAverage:
    samples, joints = position.shape
    bins = samples // 2 + 1
    tiny = 1e-14
    return PeriodAverage(
        joint_names=load_robot("ir361").joint_names,
        sample_period_s=CYCLE_S,
        position=position,
        torque_nm=torque,
        position_variance=np.full(joints, tiny),
        torque_variance=np.full(joints, NOISE_NM**2),
        position_bin_variance=np.full((bins, joints), tiny / samples),
        torque_bin_variance=np.full((bins, joints), NOISE_NM**2 / samples),
        periods_kept=PERIODS,
    )


def main() -> int:
    """Measure, and print the figures; the last line is one JSON object."""
    experiments = 50 if is_short(__doc__) else 200
    found = coverage(experiments)
    print(f"{experiments} experiments with model error; 2-sigma intervals with the true value:")
    print(f"  cluster-robust interval (jackknife)  {100 * found.clustered:.1f} %")
    print(f"  residuals assumed white              {100 * found.white:.1f} %")
    print(f"  measured noise alone                 {100 * found.noise:.1f} %")
    holds = LOW <= found.clustered <= HIGH
    print(
        json.dumps(
            {
                "name": "coverage",
                "value": round(100.0 * found.clustered, 1),
                "unit": "% of parameters inside two sigma",
                "ratios": {
                    "white residuals": round(found.clustered / found.white, 2),
                    "noise alone": round(found.clustered / found.noise, 2),
                },
                "bar": f"{100 * LOW:g} to {100 * HIGH:g} % at nominal 95 %",
                "holds": holds,
            }
        )
    )
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
