"""Resampling of a device's rows at other times: low-pass to the common band, then interpolation.

A windowed sine cardinal does both in one sum over the rows around each time (Kaiser window,
80 dB). With f the smaller of the two rates, signals below 0.4 f pass with an error of 1e-4, and
signals above 0.6 f, which would alias onto them, are attenuated to 1e-4.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from config.arrays import BoolArray, FloatArray, IntArray
from config.errors import DataQualityError

PASS_ERROR: Final = 2e-4
HALF_WIDTH: Final = 12.6
KAISER_BETA: Final = 7.86
LONGEST_FILLED_GAP: Final = 3
BLOCK: Final = 1024


def resample(
    row_s: FloatArray, values: FloatArray, valid: BoolArray, at_s: FloatArray, at_rate_hz: float
) -> tuple[FloatArray, BoolArray]:
    """Return rows of a device at other times, and their validity.

    Args:
        row_s: Shape (rows,). Times of the rows, increasing, on a regular grid in which rows may be
            missing [s].
        values: Shape (rows, channels). The rows.
        valid: Shape (rows, channels). False for invalid values, such as in saturation.
        at_s: Shape (samples,). Requested times [s].
        at_rate_hz: Rate of the requested times [Hz].

    Returns:
        `samples`, shape (samples, channels). Zero if not valid. `valid`, shape (samples, channels).
        False before the first row, after the last one, and within 12.6 / f of one of these two, of
        an invalid value, or of a gap of more than three rows.

    Raises:
        DataQualityError: There are too few rows, or their times are not regular.
    """
    place, step_s = _grid(row_s)
    size, channels = int(place[-1]) + 1, values.shape[1]
    there = np.zeros((size, channels), dtype=np.bool_)
    there[place] = valid
    gaps = _short_gaps(place, size)
    filled = _fill(place, values, gaps)
    bad = ~(there | gaps[:, np.newaxis])
    rate_hz = min(1.0 / step_s, at_rate_hz)
    half_rows = HALF_WIDTH / rate_hz / step_s
    position = (np.asarray(at_s) - row_s[0]) / step_s
    inside = (position >= half_rows) & (position <= size - 1 - half_rows)
    reach = math.ceil(half_rows)
    offsets = np.arange(-reach, reach + 1)
    bad_before = np.concatenate([np.zeros((1, channels), np.int64), np.cumsum(bad, axis=0)])
    samples = np.zeros((len(position), channels))
    good = np.zeros((len(position), channels), dtype=np.bool_)
    wanted = np.flatnonzero(inside)
    for start in range(0, len(wanted), BLOCK):
        block = wanted[start : start + BLOCK]
        nearest = np.rint(position[block]).astype(np.int64)
        rows = nearest[:, np.newaxis] + offsets
        weights = _kernel(position[block, np.newaxis] - rows, rate_hz * step_s, half_rows)
        weights[(rows < 0) | (rows >= size)] = 0.0
        weights /= weights.sum(axis=1, keepdims=True)
        around = filled[np.clip(rows, 0, size - 1)]
        samples[block] = np.einsum("ij,ijc->ic", weights, around)
        first, last = np.maximum(nearest - reach, 0), np.minimum(nearest + reach + 1, size)
        good[block] = bad_before[last] == bad_before[first]
    samples[~good] = 0.0
    return samples, good


def _grid(row_s: FloatArray) -> tuple[IntArray, float]:
    """Return the index of each row on its regular time grid, and the grid's step."""
    if len(row_s) < 2:
        raise DataQualityError(
            f"{len(row_s)} rows of the device are too few for resampling", code="RID-PLATE-CLOCK"
        )
    steps = np.diff(row_s)
    step_s = float(np.median(steps))
    if step_s > 0.0 and (steps > 0.5 * step_s).all():
        place = np.concatenate([[0], np.cumsum(np.rint(steps / step_s).astype(np.int64))])
        # The median is as coarse as the stamps; the whole run gives a much more accurate step.
        step_s = float((row_s[-1] - row_s[0]) / place[-1])
        if np.abs(row_s - row_s[0] - place * step_s).max() < 0.25 * step_s:
            return place, step_s
    raise DataQualityError(
        f"the device's rows are not on a regular grid of {step_s:.6g} s: check its time stamps",
        code="RID-PLATE-CLOCK",
    )


def _fill(place: IntArray, values: FloatArray, gaps: BoolArray) -> FloatArray:
    """Return the whole grid, with gaps interpolated by a cubic through their neighbours."""
    grid = np.zeros((len(gaps), values.shape[1]))
    grid[place] = values
    for row in np.flatnonzero(gaps):
        right = int(np.searchsorted(place, row))
        near = np.arange(max(0, right - 2), min(len(place), right + 2))
        x = (place[near] - row).astype(np.float64)
        # Lagrange's interpolation formula at x = 0.
        others = np.where(
            np.eye(len(x), dtype=bool), 1.0, -x / (x[:, np.newaxis] - x + np.eye(len(x)))
        )
        grid[row] = np.prod(others, axis=1) @ values[near]
    return grid


def _short_gaps(place: IntArray, size: int) -> BoolArray:
    """Return True for grid indices in gaps that are short enough to be filled, (size,)."""
    short = np.zeros(size, dtype=np.bool_)
    for left in np.flatnonzero((np.diff(place) > 1) & (np.diff(place) <= LONGEST_FILLED_GAP + 1)):
        short[place[left] + 1 : place[left + 1]] = True
    return short


def _kernel(distance: FloatArray, band: float, half: float) -> FloatArray:
    """Return the windowed sine cardinal at distances; distances and `half` are in rows."""
    inside = np.maximum(1.0 - (distance / half) ** 2, 0.0)
    window = np.i0(KAISER_BETA * np.sqrt(inside)) / np.i0(KAISER_BETA)
    return np.asarray(np.where(np.abs(distance) <= half, window * np.sinc(band * distance), 0.0))
