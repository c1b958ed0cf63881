"""`FoldedPeriod`: mean period of a motion that an instrument sampled on its own clock."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.signals.bins import Bins
from config.arrays import FloatArray
from config.errors import DataQualityError

ROWS_PER_UNKNOWN: Final = 2
LARGEST_GAP: Final = 0.4
"""Largest gap of the folded rows, in periods of the highest harmonic."""
SPIKE: Final = 8.0
"""Distance from the mean period, in robust standard deviations, of a row that is left out."""
ROUNDS: Final = 5
SETTLED: Final = 1e-9
_CHUNK: Final = 4096


@dataclass(frozen=True, eq=False)
class FoldedPeriod:
    """Bins of a periodic signal, from samples at any times.

    Attributes:
        bins: Shape (H + 1, channels). Bins 0 to H; see `acquisition.signals.bins`.
        sigma: Shape (channels,). Standard deviation of the noise of a bin's real part.
    """

    bins: Bins
    sigma: FloatArray


def fold_period(
    time_s: FloatArray, values: FloatArray, period_s: float, harmonics: int
) -> FoldedPeriod:
    """Return the mean period by a least-squares fit of harmonics to all rows.

    Single rows that lie far from the mean period, such as those of an interrupted beam, are left
    out. The rate of the clock is corrected such that all periods agree. The result has fewer
    harmonics if the rows of all periods together leave gaps.

    Args:
        time_s: Shape (rows,). Times since the beginning of a period [s].
        values: Shape (rows, channels). The samples.
        period_s: The period [s].
        harmonics: Highest harmonic that is wanted.

    Raises:
        DataQualityError: The rows do not determine a single harmonic.
    """
    phase, middle = time_s / period_s, float(np.median(time_s)) / period_s
    count = _most_harmonics(phase, harmonics)
    if count < 1:
        raise DataQualityError(
            f"{len(time_s)} rows do not determine the mean period of {period_s:.3g} s: record the"
            " whole motion",
            code="RID-TRACKER-RATE",
        )
    factors = _fit(phase, values, count)
    left = values - _values(phase, factors)
    distance = np.abs(left - np.median(left, axis=0))
    spread = 1.4826 * np.median(distance, axis=0)
    used = (distance <= SPIKE * np.maximum(spread, 1e-12)).all(axis=1)
    if not used.all() and _most_harmonics(phase[used], count) == count:
        phase, values = phase[used], values[used]
    for _ in range(ROUNDS):
        factors = _fit(phase, values, count)
        left = values - _values(phase, factors)
        drift = _values(phase, _slopes(factors)) * (phase - middle)[:, np.newaxis]
        drift -= _values(phase, _fit(phase, drift, count))
        rate = float(np.sum(drift * left) / max(float(np.sum(drift**2)), 1e-300))
        phase = phase + rate * (phase - middle)
        if abs(rate) < SETTLED:
            break
    rows = len(left)
    variance = np.sum(left**2, axis=0) / (rows - len(factors))
    bins = np.zeros((count + 1, values.shape[1]), dtype=np.complex128)
    bins[0] = factors[0]
    bins[1:] = 0.5 * (factors[1 : count + 1] - 1j * factors[count + 1 :])
    return FoldedPeriod(bins, np.sqrt(0.5 * variance / rows))


def _most_harmonics(phase: FloatArray, wanted: int) -> int:
    """Return the number of harmonics that the rows determine, at most `wanted`."""
    if len(phase) < 2:
        return 0
    ordered = np.sort(phase % 1.0)
    gap = max(float(np.diff(ordered).max()), float(ordered[0] + 1.0 - ordered[-1]))
    by_rows = (len(phase) // ROWS_PER_UNKNOWN - 1) // 2
    return min(wanted, by_rows, math.floor(LARGEST_GAP / max(gap, 1e-9)))


def _columns(phase: FloatArray, count: int) -> FloatArray:
    angle = 2.0 * math.pi * phase[:, np.newaxis] * np.arange(1, count + 1)
    return np.column_stack([np.ones(len(phase)), np.cos(angle), np.sin(angle)])


def _fit(phase: FloatArray, values: FloatArray, count: int) -> FloatArray:
    """Return the factors of constant, cosines and sines, (1 + 2 count, channels)."""
    square = np.zeros((1 + 2 * count, 1 + 2 * count))
    right = np.zeros((1 + 2 * count, values.shape[1]))
    for first in range(0, len(phase), _CHUNK):
        rows = slice(first, first + _CHUNK)
        columns = _columns(phase[rows], count)
        square += columns.T @ columns
        right += columns.T @ values[rows]
    return np.asarray(np.linalg.solve(square, right))


def _slopes(factors: FloatArray) -> FloatArray:
    """Return the factors of the derivative with respect to the phase."""
    count = (len(factors) - 1) // 2
    turns = 2.0 * math.pi * np.arange(1, count + 1)[:, np.newaxis]
    cosines, sines = factors[1 : count + 1], factors[count + 1 :]
    return np.asarray(np.concatenate([0.0 * factors[:1], turns * sines, -turns * cosines]))


def _values(phase: FloatArray, factors: FloatArray) -> FloatArray:
    count = (len(factors) - 1) // 2
    parts = [
        _columns(phase[first : first + _CHUNK], count) @ factors
        for first in range(0, len(phase), _CHUNK)
    ]
    return np.concatenate(parts)
