"""`FourierTrajectory`: periodic excitation trajectory (2.30, 3.11, 3.12)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from config.arrays import FloatArray, freeze
from config.errors import ConfigError


def samples_of_period(period_s: float, sample_period_s: float) -> int:
    """Return the number of samples in one period.

    Args:
        period_s: Length of the period [s].
        sample_period_s: Time between samples [s].

    Raises:
        ConfigError: The period is not a whole number of samples (the message names the nearest
            valid periods), or has fewer than four samples.
    """
    exact = period_s / sample_period_s
    samples = round(exact)
    if abs(exact - samples) > 1e-6:
        nearest = " and ".join(
            f"{whole * sample_period_s:.9g} s ({whole} cycles)"
            for whole in (math.floor(exact), math.ceil(exact))
        )
        raise ConfigError(
            f"period_s {period_s:g} is {exact:.9g} cycles of {sample_period_s * 1e3:g} ms, but"
            f" must be a whole number of cycles. Nearest valid periods: {nearest}",
            code="RID-MOTION-PERIOD",
        )
    if samples < 4:
        raise ConfigError(
            f"period_s {period_s:g} has {samples} cycles of {sample_period_s * 1e3:g} ms, but at"
            f" least 4 are needed: choose {4.0 * sample_period_s:g} s or more",
            code="RID-MOTION-PERIOD",
        )
    return samples


@dataclass(frozen=True, eq=False)
class FourierTrajectory:
    """Fourier series for each joint, with a whole number of samples per period.

    Attributes:
        joint_names: Joints from base to flange.
        sample_period_s: Time between samples [s].
        samples_per_period: Number of samples per period, K.
        offset: Shape (joints,). q_i0 [rad or m].
        sine, cosine: Shape (harmonics, joints). a_ik and b_ik [rad or m]; row k - 1 belongs to
            harmonic k.
    """

    joint_names: tuple[str, ...]
    sample_period_s: float
    samples_per_period: int
    offset: FloatArray
    sine: FloatArray
    cosine: FloatArray

    def __post_init__(self) -> None:
        n = len(self.joint_names)
        freeze(self, ConfigError, (n,), "offset", what="Fourier ")
        freeze(self, ConfigError, (None, n), "sine", what="Fourier ")
        freeze(self, ConfigError, self.sine.shape, "cosine", what="Fourier ")
        if 2 * len(self.sine) >= self.samples_per_period:
            raise ConfigError(
                f"harmonic {len(self.sine)} of a period of {self.samples_per_period} samples is"
                " not below half the sampling frequency: use fewer harmonics or a longer period",
                code="RID-MOTION-BAND",
            )

    @property
    def period_s(self) -> float:
        """Length of the period [s]."""
        return self.samples_per_period * self.sample_period_s

    @property
    def harmonics(self) -> int:
        """Number of the highest harmonic, N."""
        return len(self.sine)

    @property
    def sample_times_s(self) -> FloatArray:
        """Times of the samples of one period, from 0 [s]; shape (samples_per_period,)."""
        return np.arange(self.samples_per_period, dtype=np.float64) * self.sample_period_s

    def position(self, time_s: FloatArray) -> FloatArray:
        """Return q(t) [rad or m], shape (len(time_s), joints); (3.11)."""
        return self._series(time_s, 0) + self.offset

    def velocity(self, time_s: FloatArray) -> FloatArray:
        """Return the first time derivative of q(t), shape (len(time_s), joints)."""
        return self._series(time_s, 1)

    def acceleration(self, time_s: FloatArray) -> FloatArray:
        """Return the second time derivative of q(t), shape (len(time_s), joints)."""
        return self._series(time_s, 2)

    def _series(self, time_s: FloatArray, derivative: int) -> FloatArray:
        """Return a derivative of the sum over harmonics, as the real part of phasors."""
        omega = 2.0 * math.pi / self.period_s * np.arange(1, self.harmonics + 1)
        turns = np.exp(1j * np.outer(np.asarray(time_s, dtype=float), omega))
        # a sin(wt) + b cos(wt) = Re[(b - j a) exp(jwt)], and d/dt multiplies by j w.
        phasors = (self.cosine - 1j * self.sine) * ((1j * omega) ** derivative)[:, np.newaxis]
        return np.asarray((turns @ phasors).real)
