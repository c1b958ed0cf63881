"""Recordings of an arm with a motion in closed form, with correct and wrong time stamps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acquisition.clock.samples import Samples
from config.arrays import BoolArray, FloatArray

PERIOD_S = 0.008
STEP_RAD = 2.0 * np.pi / 2**19


@dataclass(frozen=True, eq=False)
class LoggedArm:
    """Motion of an arm: sums of sines without a common period, from a seed.

    Attributes:
        amplitude, omega, phase: Shape (joints, sines) [rad, rad/s, rad]. A joint's position is the
            sum of amplitude * sin(omega * t + phase).
    """

    amplitude: FloatArray
    omega: FloatArray
    phase: FloatArray

    @classmethod
    def of(cls, seed: int, joints: int = 4) -> LoggedArm:
        """Return an arm that moves by up to 1.5 rad."""
        random = np.random.default_rng(seed)
        amplitude = random.uniform(0.4, 1.0, (joints, 5))
        amplitude *= 1.5 / amplitude.sum(axis=1, keepdims=True)
        omega = 2.0 * np.pi * random.uniform(0.06, 0.6, (joints, 5))
        return cls(amplitude, omega, random.uniform(0.0, 6.28, (joints, 5)))

    def at(self, true_s: FloatArray, stamps: FloatArray, seed: int = 0) -> Samples:
        """Return samples at the true times with the given time stamps.

        Rows with the same true time differ in their time stamps only.

        Positions have the steps of a 19-bit encoder; velocities and torques are noisy.
        """
        moments, rows = np.unique(true_s, return_inverse=True)
        angle = self.omega * moments[:, np.newaxis, np.newaxis] + self.phase
        q = (self.amplitude * np.sin(angle)).sum(axis=2)
        v = (self.amplitude * self.omega * np.cos(angle)).sum(axis=2)
        a = -(self.amplitude * self.omega**2 * np.sin(angle)).sum(axis=2)
        random = np.random.default_rng(seed)
        torque = 5.0 * a + 8.0 * np.sin(q) + 3.0 * np.sign(v) + random.normal(0.0, 0.02, q.shape)
        v = v + random.normal(0.0, 3e-4, v.shape)
        q = np.round(q / STEP_RAD) * STEP_RAD
        return Samples(stamps, q[rows], v[rows], torque[rows])


def row_times(rows: int = 2500) -> FloatArray:
    """Return the times of rows at 125 Hz [s]."""
    return np.asarray(np.arange(rows) * PERIOD_S, dtype=np.float64)


def inserted(true_s: FloatArray, repeat: BoolArray) -> FloatArray:
    """Return the true times of the rows if the rows with `repeat` are written twice."""
    return np.asarray(np.repeat(true_s, np.where(repeat, 2, 1)))


def time_error(time_s: FloatArray, true_s: FloatArray) -> float:
    """Return the RMS error of time stamps after correction of a constant offset and rate [s]."""
    fit = np.polyfit(time_s - time_s[0], true_s, 1)
    return float(np.sqrt(np.mean((np.polyval(fit, time_s - time_s[0]) - true_s) ** 2)))
