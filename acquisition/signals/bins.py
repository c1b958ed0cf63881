"""Periodic signals on their DFT bins: exact differentiation, resampling and removal of a filter.

A signal of whole periods is completely described by the bins k / (K T); a bin is `numpy.fft.rfft(x,
axis=0)[k] / K`. On the bins, differentiation is multiplication by j k omega (theory: section 1),
and the anti-alias filter is removed by division (theory: section 8).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from config.arrays import FloatArray
from config.cell.torque_filter import ButterworthFilter
from config.errors import ConfigError

Bins = NDArray[np.complex128]


class Derivatives(NamedTuple):
    """A signal with its first two time derivatives, each of shape (samples, joints)."""

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


def to_bins(samples: FloatArray, harmonics: int) -> Bins:
    """Return the bins 0 to `harmonics` of one period.

    Args:
        samples: Shape (K, joints). One period.
        harmonics: Highest bin, below K / 2.

    Returns:
        Shape (harmonics + 1, joints).

    Raises:
        ConfigError: `harmonics` is not below half the number of samples.
    """
    _check_harmonics(harmonics, len(samples))
    return np.asarray(np.fft.rfft(samples, axis=0)[: harmonics + 1] / len(samples))


def from_bins(bins: Bins, samples: int) -> FloatArray:
    """Return one period of `samples` rows from its bins 0 to len(bins) - 1.

    Raises:
        ConfigError: The bins reach half the number of samples.
    """
    _check_harmonics(len(bins) - 1, samples)
    return np.asarray(np.fft.irfft(bins * samples, n=samples, axis=0))


def differentiate_on_bins(
    samples: FloatArray, sample_period_s: float, harmonics: int, *, oversampling: int = 1
) -> Derivatives:
    """Return a periodic signal, its velocity and acceleration, limited to bins 0 to `harmonics`.

    Args:
        samples: Shape (K, joints). One period [rad or m].
        sample_period_s: Time between rows [s].
        harmonics: Highest bin, below K / 2.
        oversampling: Returned rows per given row. Products of the signals have higher harmonics,
            and a finer grid avoids their aliasing.

    Raises:
        ConfigError: `harmonics` is not below half the number of samples.
    """
    bins = to_bins(samples, harmonics)
    rows = len(samples) * oversampling
    omega = 2.0 * math.pi / (len(samples) * sample_period_s) * np.arange(harmonics + 1)
    derivative = (1j * omega)[:, np.newaxis]
    return Derivatives(
        from_bins(bins, rows),
        from_bins(bins * derivative, rows),
        from_bins(bins * derivative**2, rows),
    )


def filter_response(torque_filter: ButterworthFilter, frequency_hz: FloatArray) -> Bins:
    """Return the analog filter's complex response at each frequency [Hz]; it is 1 at 0 Hz."""
    order = torque_filter.order
    poles = np.exp(1j * math.pi * (2 * np.arange(order) + order + 1) / (2 * order))
    s = 1j * np.asarray(frequency_hz, dtype=float) / torque_filter.cutoff_hz
    return np.asarray(1.0 / np.prod(s[:, np.newaxis] - poles, axis=1))


def divide_filter(
    samples: FloatArray,
    sample_period_s: float,
    torque_filter: ButterworthFilter | None,
    harmonics: int,
) -> FloatArray:
    """Return a period without its anti-alias filter, limited to bins 0 to `harmonics`.

    Args:
        samples: Shape (K, joints). One filtered period.
        sample_period_s: Time between rows [s].
        torque_filter: The filter; None only limits the bins.
        harmonics: Highest bin, below K / 2.

    Raises:
        ConfigError: `harmonics` is not below K / 2, or the filter passes less than 1 % there:
            division would only amplify noise.
    """
    bins = to_bins(samples, harmonics)
    if torque_filter is not None:
        frequency_hz = np.arange(harmonics + 1) / (len(samples) * sample_period_s)
        response = filter_response(torque_filter, frequency_hz)
        if abs(response[-1]) < 0.01:
            raise ConfigError(
                f"the torque filter passes {abs(response[-1]):.2g} of harmonic {harmonics}"
                f" ({frequency_hz[-1]:.4g} Hz): use harmonics nearer to its cut-off of"
                f" {torque_filter.cutoff_hz:g} Hz",
                code="RID-MOTION-BAND",
            )
        bins = bins / response[:, np.newaxis]
    return from_bins(bins, len(samples))


def _check_harmonics(harmonics: int, samples: int) -> None:
    if not 0 <= 2 * harmonics < samples:
        raise ConfigError(
            f"harmonic {harmonics} does not fit a period of {samples} samples: use at most"
            f" {(samples - 1) // 2} harmonics",
            code="RID-MOTION-BAND",
        )
