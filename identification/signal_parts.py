"""Contiguous parts of smoothed recordings, and averaged periods as such recordings."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from acquisition.periods import PeriodAverage
from acquisition.smoothing import SmoothedSignals
from acquisition.spectrum import differentiate_on_bins, filter_response, from_bins, to_bins
from identification.bin_equations import harmonics_below


def cut(signals: SmoothedSignals, parts: int) -> list[SmoothedSignals]:
    """Cut a recording into contiguous parts of equal length."""
    edges = np.linspace(0, len(signals), parts + 1).astype(int)
    return [_rows(signals, slice(a, b)) for a, b in pairwise(edges)]


def period_signals(average: PeriodAverage, band_hz: float) -> SmoothedSignals:
    """Return a mean period as a recording below `band_hz`, the anti-alias filter divided out."""
    harmonics = harmonics_below(average, band_hz)
    q, v, a = differentiate_on_bins(average.position, average.sample_period_s, harmonics)
    torque = to_bins(average.torque_nm, harmonics)
    if average.torque_filter is not None:
        frequency_hz = np.arange(harmonics + 1) / average.period_s
        torque = torque / filter_response(average.torque_filter, frequency_hz)[:, np.newaxis]
    rows = len(q)
    warmth = average.temperature_k
    return SmoothedSignals(
        joint_names=average.joint_names,
        time_s=np.arange(rows, dtype=np.float64) * average.sample_period_s,
        position=q,
        velocity=v,
        acceleration=a,
        torque_nm=from_bins(torque, rows),
        segment=np.zeros(rows, dtype=np.int64),
        sample_period_s=average.sample_period_s,
        cutoff_hz=harmonics / average.period_s,
        temperature_k=None if warmth is None else np.tile(warmth, (rows, 1)),
    )


def _rows(signals: SmoothedSignals, rows: slice) -> SmoothedSignals:
    warmth = signals.temperature_k
    return replace(
        signals,
        time_s=signals.time_s[rows],
        position=signals.position[rows],
        velocity=signals.velocity[rows],
        acceleration=signals.acceleration[rows],
        torque_nm=signals.torque_nm[rows],
        segment=signals.segment[rows],
        temperature_k=None if warmth is None else warmth[rows],
    )
