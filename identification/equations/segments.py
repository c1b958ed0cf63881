"""Parts and selected rows of smoothed recordings; averaged periods as smoothed recordings."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any, Final

import numpy as np

from acquisition.processing.period_table import cut_periods
from acquisition.processing.periods import PeriodAverage
from acquisition.processing.smoothing import SmoothedSignals, low_pass
from acquisition.processing.unfiltered import (
    UnfilteredSignals,
    smooth_gaussian,
    smoothing_width,
)
from acquisition.recording.recording import Recording
from acquisition.signals.bins import differentiate_on_bins, filter_response, from_bins, to_bins
from acquisition.signals.splines import quintic_derivatives
from config.arrays import BoolArray, FloatArray
from config.errors import DataQualityError
from identification.equations.bins import harmonics_below
from identification.equations.deconvolution import HIGHEST_SHARE, SMALLEST_GAIN

ROWS_PER_PERIOD: Final = 8
SPLINE_ROWS: Final = 20
"""Number of rows at each end of a spline that its end conditions affect."""
FILTER_PERIODS: Final = 6.0
"""Duration of a Butterworth low-pass's transient [periods of its cut-off]."""


def split_recording(signals: SmoothedSignals, parts: int) -> list[SmoothedSignals]:
    """Cut a recording into contiguous parts of equal length."""
    edges = np.linspace(0, len(signals), parts + 1).astype(int)
    return [_rows(signals, slice(a, b)) for a, b in pairwise(edges)]


def thin_rows(signals: SmoothedSignals) -> SmoothedSignals:
    """Return every k-th row of each segment, at least 8 in a period of the cut-off frequency.

    Such rows fully represent signals below the cut-off. They do not represent the jump of a
    friction model at a reversal. Therefore an estimate changes by a fraction of its interval, but
    comparisons of models hardly change.
    """
    stride = row_stride(signals)
    if stride <= 1:
        return signals
    starts = np.flatnonzero(np.diff(signals.segment, prepend=-1) != 0)
    rows = np.arange(len(signals))
    within = rows - starts[np.searchsorted(starts, rows, side="right") - 1]
    kept = _rows(signals, within % stride == 0)
    return replace(kept, sample_period_s=stride * signals.sample_period_s)


def row_stride(signals: SmoothedSignals) -> int:
    """Return k such that every k-th row is enough: 8 rows in a period of the cut-off."""
    return max(1, int(1.0 / (ROWS_PER_PERIOD * signals.cutoff_hz * signals.sample_period_s)))


def period_signals(average: PeriodAverage, band_hz: float) -> SmoothedSignals:
    """Return a mean period as a recording below `band_hz`, the anti-alias filter divided out."""
    return _limited_to_band(
        average, (average.position, average.torque_nm), band_hz, average.temperature_k
    )


def unfiltered_period_signals(average: PeriodAverage, band_hz: float) -> SmoothedSignals:
    """Return a mean period as `period_signals` does, together with its unfiltered signals.

    These include the rows before and after the period that affect filtered rows.
    """
    signals = period_signals(average, band_hz)
    rows, step_s, passed = (
        average.samples_per_period,
        average.sample_period_s,
        average.torque_filter,
    )
    limit_hz = None
    torque_nm = average.torque_nm
    if passed is not None:
        limit_hz = min(max(passed.cutoff_hz, signals.cutoff_hz), HIGHEST_SHARE / step_s)
        frequency_hz = np.asarray(np.fft.rfftfreq(rows, step_s), dtype=np.float64)
        response = filter_response(passed, frequency_hz)
        response /= np.minimum(1.0, np.abs(response) / SMALLEST_GAIN)
        bins = np.fft.rfft(torque_nm, axis=0) / response[:, np.newaxis]
        torque_nm = np.fft.irfft(bins, n=rows, axis=0)
    reach_s = 1.0 / signals.cutoff_hz + (0.0 if limit_hz is None else FILTER_PERIODS / limit_hz)
    margin = math.ceil(reach_s / step_s) + 2 * SPLINE_ROWS
    at = np.arange(-margin, rows + margin) % rows
    position, torque_nm = average.position[at], torque_nm[at]
    width_s = smoothing_width(average.position, step_s)
    motion = (position, *quintic_derivatives(position, step_s))
    if limit_hz is not None:
        torque_nm = low_pass(torque_nm, step_s, limit_hz)
    q, v, a, torque = (smooth_gaussian(values, step_s, width_s) for values in (*motion, torque_nm))
    inner = slice(SPLINE_ROWS, len(at) - SPLINE_ROWS)
    return replace(
        signals,
        unfiltered=UnfilteredSignals(
            time_s=step_s * np.arange(-margin, rows + margin, dtype=np.float64)[inner],
            position=q[inner],
            velocity=v[inner],
            acceleration=a[inner],
            torque_nm=torque[inner],
            segment=np.zeros(len(at), dtype=np.int64)[inner],
            sample_period_s=step_s,
            smoothing_s=width_s,
            torque_limit_hz=limit_hz,
        ),
        unfiltered_row=np.arange(rows) + margin - SPLINE_ROWS,
    )


def single_periods(
    recording: Recording, band_hz: float, start: int | None = None
) -> dict[int, SmoothedSignals]:
    """Return the signals of each complete period of a recording, by its number.

    Args:
        recording: Recording of a periodic motion, or a part that begins with a period.
        band_hz: Upper limit of the frequency band that is kept [Hz].
        start: Row of the motion at which the recording's first period begins, if it is known.

    Raises:
        DataQualityError: The recording is not periodic, its time stamps are not uniform, or too
            many rows are missing.
    """
    values, present = cut_periods(recording, start)
    warmth = recording.temperature_k
    n = len(recording.joint_names)
    return {
        int(number): _limited_to_band(
            recording,
            (values[number, :, :n], values[number, :, n:]),
            band_hz,
            None if warmth is None else warmth.mean(axis=0),
        )
        for number in np.flatnonzero(present.all(axis=(1, 2)))
    }


def _limited_to_band(
    source: PeriodAverage | Recording,
    period: tuple[FloatArray, FloatArray],
    band_hz: float,
    temperature_k: FloatArray | None,
) -> SmoothedSignals:
    """Return position and torque (K, n) of one period, limited to the band, with derivatives."""
    position, torque_nm = period
    rows, step_s = len(position), source.sample_period_s
    if step_s is None:
        raise DataQualityError(
            "the recording's time stamps are not uniform, so its harmonics cannot be computed:"
            " record with a constant sample period",
            code="RID-RECORDING-CLOCK",
        )
    period_s = rows * step_s
    harmonics = harmonics_below(band_hz, period_s, step_s, source.torque_filter)
    q, v, a = differentiate_on_bins(position, step_s, harmonics)
    torque = to_bins(torque_nm, harmonics)
    if source.torque_filter is not None:
        frequency_hz = np.arange(harmonics + 1) / period_s
        torque = torque / filter_response(source.torque_filter, frequency_hz)[:, np.newaxis]
    return SmoothedSignals(
        joint_names=source.joint_names,
        time_s=np.arange(rows, dtype=np.float64) * step_s,
        position=q,
        velocity=v,
        acceleration=a,
        torque_nm=from_bins(torque, rows),
        segment=np.zeros(rows, dtype=np.int64),
        sample_period_s=step_s,
        cutoff_hz=harmonics / period_s,
        temperature_k=None if temperature_k is None else np.tile(temperature_k, (rows, 1)),
    )


def _rows(signals: SmoothedSignals, rows: slice | BoolArray) -> SmoothedSignals:
    split_recording: dict[str, Any] = {
        k: x[rows] for k, x in vars(signals).items() if isinstance(x, np.ndarray)
    }
    return replace(signals, **split_recording)
