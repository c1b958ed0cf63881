"""`UnfilteredSignals`: motion and torque of a recording at its full rate, before the low-pass.

If tau = X(q, v, a) theta, then h * tau = (h * X) theta for every linear filter h. Therefore the
columns for a low-passed torque must pass the same filter (parallel filtering). Columns computed
from low-passed signals are not the same: the sign of a low-passed velocity is not the low-passed
sign. The columns are therefore computed from these unfiltered signals. Columns and torque then pass
the same filter of finite length.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray, IntArray, freeze
from config.column_file import each_column, stored_columns
from config.errors import DataQualityError

WINDOW_PERIODS: Final = 0.72
"""Length of the filter's window, in periods of the cut-off frequency, for a gain of -3 dB there."""
SLOW_RAD_S: Final = 0.02
"""Speed above which encoder steps must not look like motion [rad/s or m/s]."""
WIDTH_STEPS: Final = 1.6
"""Standard deviation of the smoothing, relative to the duration of one encoder step at the speed
`SLOW_RAD_S`."""
WIDEST_SMOOTHING_S: Final = 8e-3
"""Largest standard deviation of the smoothing [s]."""
SMOOTHING_REACH: Final = 4.0
"""Half length of the smoothing window, in standard deviations of the Gaussian."""
NOISE_DIFFERENCES: Final = 6
"""Order of the differences from which the noise of a position is estimated."""


@dataclass(frozen=True, eq=False)
class UnfilteredSignals:
    """Motion and torque on a uniform time base.

    Attributes:
        time_s: Shape (samples,). Uniform within a segment [s].
        position, velocity, acceleration: Shape (samples, joints). rad or m, and per second, per
            second squared.
        torque_nm: Shape (samples, joints). Torque [N m or N].
        segment: Shape (samples,). Segment number of each row.
        sample_period_s: Time between rows of a segment [s].
        smoothing_s: Standard deviation of the Gaussian that smoothed all signals because the
            encoder is coarse [s]; 0 without smoothing.
        torque_limit_hz: Cut-off of the torque's low-pass, above which the torque is unknown [Hz].
        torque_row: Shape (samples, joints). Row of the last torque update for each row; None if
            every row has a new value.
    """

    time_s: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    torque_nm: FloatArray
    segment: IntArray
    sample_period_s: float
    smoothing_s: float = 0.0
    torque_limit_hz: float | None = None
    torque_row: IntArray | None = None

    def __post_init__(self) -> None:
        freeze(self, DataQualityError, (None,), "time_s")
        table = (len(self.time_s), self.position.shape[1])
        freeze(self, DataQualityError, table, "position", "velocity", "acceleration", "torque_nm")
        freeze(self, DataQualityError, (len(self.time_s),), "segment", dtype=np.int64)
        freeze(self, DataQualityError, table, "torque_row", dtype=np.int64)

    def reach(self, cutoff_hz: float) -> int:
        """Return the number of rows before and after a jump that the filters change."""
        smoothing = round(SMOOTHING_REACH * self.smoothing_s / self.sample_period_s)
        return window_reach(self.sample_period_s, cutoff_hz) + smoothing

    @property
    def held_rows(self) -> int:
        """Largest number of rows for which a torque is held after its update."""
        if self.torque_row is None:
            return 0
        return int(np.max(np.arange(len(self.torque_row))[:, np.newaxis] - self.torque_row))


def smoothing_width(position: FloatArray, step_s: float) -> float:
    """Return the smoothing's standard deviation that makes the velocity's sign reliable [s].

    It is `WIDTH_STEPS` times the duration of an encoder step at the speed `SLOW_RAD_S`, but at most
    `WIDEST_SMOOTHING_S`. If the noise of a position is larger than that of its steps, an equally
    noisy step is used. The result is 0, no smoothing, if the width is not longer than the time
    between rows.

    Args:
        position: Shape (samples, joints). Recorded positions.
        step_s: Time between rows [s].
    """
    step = max(max(_resolution(q), np.sqrt(12.0) * _noise(q)) for q in each_column(position))
    width_s = min(WIDTH_STEPS * float(step) / SLOW_RAD_S, WIDEST_SMOOTHING_S)
    return width_s if width_s > step_s else 0.0


def smooth_gaussian(values: FloatArray, step_s: float, width_s: float) -> FloatArray:
    """Return uniform rows convolved with a Gaussian of standard deviation `width_s` [s]."""
    if width_s == 0.0:
        return values
    from scipy import ndimage

    def smooth(column: FloatArray) -> FloatArray:
        return np.asarray(
            ndimage.gaussian_filter1d(
                column, width_s / step_s, mode="nearest", truncate=SMOOTHING_REACH
            )
        )

    return stored_columns(smooth, values)


def load_width_s(cutoff_hz: float) -> float:
    """Return the standard deviation of a Gaussian with -3 dB at a cut-off frequency [s]."""
    return math.sqrt(math.log(2.0)) / (2.0 * math.pi * cutoff_hz)


def window_reach(step_s: float, cutoff_hz: float) -> int:
    """Return the number of rows on each side of the centre in the window of `window_mean`."""
    return max(1, round(0.5 * WINDOW_PERIODS / (cutoff_hz * step_s)))


def window_mean(values: FloatArray, rows: IntArray, step_s: float, cutoff_hz: float) -> FloatArray:
    """Return the mean of uniform values around requested rows, weighted by a Hann window.

    This is a zero-phase low-pass of finite length, with -3 dB at the cut-off.

    Args:
        values: Shape (samples, any). Uniform rows.
        rows: Shape (wanted,). Requested rows; beyond an end of the values, the row at that end is
            repeated.
        step_s: Time between rows [s].
        cutoff_hz: -3 dB frequency [Hz].
    """
    from scipy import sparse

    half = window_reach(step_s, cutoff_hz)
    offset = np.arange(-half, half + 1)
    weight = np.cos(0.5 * np.pi * offset / (half + 1)) ** 2
    weight /= weight.sum()
    neighbours = np.clip(rows[:, np.newaxis] + offset, 0, len(values) - 1)
    mean = sparse.csr_array(
        (
            np.tile(weight, len(rows)),
            neighbours.ravel(),
            np.arange(len(rows) + 1) * len(offset),
        ),
        shape=(len(rows), len(values)),
    )
    flat = np.ascontiguousarray(values).reshape(len(values), -1)
    return np.asarray(mean @ flat).reshape(len(rows), *values.shape[1:])


def _resolution(position: FloatArray) -> float:
    """Return the resolution of a recorded position; 0 if none is visible."""
    moved = np.abs(np.diff(position))
    moved = moved[moved > 0.0]
    if len(moved) == 0:
        return 0.0
    step = float(np.quantile(moved, 0.01))
    off = np.abs(moved / step - np.round(moved / step))
    return step if np.mean(off < 0.05) > 0.99 else 0.0


def _noise(position: FloatArray) -> float:
    """Return the standard deviation of a position's white noise, from its differences."""
    if len(position) <= NOISE_DIFFERENCES:
        return 0.0
    moving = np.diff(position)[: 1 - NOISE_DIFFERENCES] != 0.0
    rough = np.abs(np.diff(position, NOISE_DIFFERENCES))[moving]
    if len(rough) == 0:
        return 0.0
    gain = 1.0
    # gain of an N-th difference of white noise: the binomial coefficient of 2 N over N
    for k in range(NOISE_DIFFERENCES):
        gain *= (2 * NOISE_DIFFERENCES - k) / (NOISE_DIFFERENCES - k)
    return float(np.median(rough)) / 0.6745 / float(np.sqrt(gain))
