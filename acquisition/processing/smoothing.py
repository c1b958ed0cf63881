"""`SmoothedSignals`: a recording that is not periodic, on a uniform time base, low-passed.

Time stamps are taken as correct: position and torque are interpolated from them, low-passed
forwards and backwards (no phase shift), and differentiated as splines. A gap in the stamps divides
the recording into segments; nothing is interpolated across a gap.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from acquisition.processing.repeated_torque import find_repeated_torques
from acquisition.processing.torque_channel import TorqueChannel
from acquisition.processing.unfiltered import (
    UnfilteredSignals,
    smooth_gaussian,
    smoothing_width,
)
from acquisition.recording.recording import Recording
from acquisition.signals.splines import quintic_derivatives, spline_at
from config.arrays import FloatArray, IntArray, freeze, lock, release
from config.column_file import ColumnFile, each_column, stored, stored_columns, stored_rows
from config.errors import ConfigError, DataQualityError

FILTER_ORDER = 4
GAP_STEPS = 5.0


@dataclass(frozen=True, eq=False)
class SmoothedSignals:
    """Position with its derivatives, and torque, below `cutoff_hz`.

    Attributes:
        joint_names: Base to flange.
        time_s: Shape (samples,). Uniform within a segment [s].
        position, velocity, acceleration: Shape (samples, joints). rad or m, and per second, per
            second squared.
        torque_nm: Shape (samples, joints). Torque with the same low-pass [N m or N].
        segment: Shape (samples,). Segment number of each row.
        sample_period_s: Time between rows of a segment [s].
        cutoff_hz: -3 dB frequency of the low-pass. Rows are correlated: a signal limited to this
            band has about 2 cutoff_hz independent values per second.
        temperature_k: Shape (samples, joints). Temperature of each drive [K], if recorded.
        channel: Delay and filter of the recorded torque, if known; they are applied to the model's
            torque too.
        unfiltered: The same recording at its full rate before the low-pass; None for a mean period,
            which is known below the cut-off only.
        unfiltered_row: Shape (samples,). Index of each row in `unfiltered`.
    """

    joint_names: tuple[str, ...]
    time_s: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    torque_nm: FloatArray
    segment: IntArray
    sample_period_s: float
    cutoff_hz: float
    temperature_k: FloatArray | None = None
    channel: TorqueChannel | None = None
    unfiltered: UnfilteredSignals | None = None
    unfiltered_row: IntArray | None = None

    def __post_init__(self) -> None:
        freeze(self, DataQualityError, (None,), "time_s")
        table = (len(self), len(self.joint_names))
        freeze(self, DataQualityError, table, "position", "velocity", "acceleration", "torque_nm")
        freeze(self, DataQualityError, table, "temperature_k")
        freeze(self, DataQualityError, (len(self),), "segment", dtype=np.int64)
        freeze(self, DataQualityError, (len(self),), "unfiltered_row", dtype=np.int64)

    def __len__(self) -> int:
        return len(self.time_s)

    def release(self) -> None:
        """Return the memory of all arrays to the system; their values stay in files."""
        for source in (self, self.unfiltered):
            own = () if source is None else vars(source).values()
            release(*(values for values in own if isinstance(values, np.ndarray)))


class _Segment(NamedTuple):
    time_s: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    torque_nm: FloatArray


def _steps(duration_s: float, step_s: float) -> float:
    """Return a duration in steps, rounded to 0.001 to remove rounding errors of the time stamps."""
    return round(duration_s / step_s, 3)


def low_pass(values: FloatArray, sample_period_s: float, cutoff_hz: float) -> FloatArray:
    """Return uniform samples after a zero-phase low-pass with -3 dB at `cutoff_hz`.

    A Butterworth filter of order 4 runs forwards and backwards; time is the first axis.

    Raises:
        ConfigError: The cut-off is not between 0 and 0.45 times the sampling rate.
    """
    if not 0.0 < cutoff_hz < 0.45 / sample_period_s:
        step = sample_period_s
        every = f"{step:.4g} s" if step >= 1.0 else f"{1e3 * step:.4g} ms"
        raise ConfigError(
            f"a cut-off frequency of {cutoff_hz:g} Hz does not fit samples every {every}: choose"
            f" one between 0 and {0.45 / step:.4g} Hz",
            code="RID-RECORDING-CUTOFF",
        )
    from dynamics.kernels.low_pass import filter_both_ways  # loads the compiler

    sections, start = _sections(cutoff_hz * sample_period_s)
    padding = min(len(values) - 1, math.ceil(_steps(3.0 / cutoff_hz, sample_period_s)))
    longer = np.empty((len(values) + 2 * padding, *values.shape[1:]))
    # extend the signal by a point reflection about its end
    longer[:padding] = 2.0 * values[:1] - values[padding:0:-1]
    longer[padding : padding + len(values)] = values
    longer[padding + len(values) :] = 2.0 * values[-1:] - values[-2 : -padding - 2 : -1]
    filter_both_ways(sections, start, longer.reshape(len(longer), -1))
    return longer[padding : padding + len(values)]


def _low_passed(values: FloatArray, sample_period_s: float, cutoff_hz: float) -> FloatArray:
    """Return `low_pass` of a table, column by column, in a file."""
    return stored_columns(lambda column: low_pass(column, sample_period_s, cutoff_hz), values)


@lru_cache(maxsize=64)
def _sections(cutoff: float) -> tuple[FloatArray, FloatArray]:
    """Return second-order sections for a cut-off [cycles per sample], and their initial states."""
    # Two passes, forwards and backwards, have the gain 1 / (1 + (g(f) / g(f0))^8).
    # The bilinear transform gives g(f) = tan(pi f T); f0 makes the gain -3 dB at the cut-off.
    warped = np.tan(np.pi * cutoff)
    warped /= (np.sqrt(2.0) - 1.0) ** (0.5 / FILTER_ORDER)
    # Each section is the bilinear transform of w^2 / (s^2 + 2 d w s + w^2). `scipy.signal` has the
    # same filter, but its import takes longer than most commands.
    sections = np.empty((FILTER_ORDER // 2, 6))
    for section, pair in zip(sections, range(FILTER_ORDER // 2, 0, -1), strict=True):
        damped = 2.0 * np.sin(np.pi * (2 * pair - 1) / (2 * FILTER_ORDER)) * warped
        scale = 1.0 + damped + warped**2
        section[:3] = warped**2 / scale * np.array([1.0, 2.0, 1.0])
        section[3:] = 1.0, 2.0 * (warped**2 - 1.0) / scale, (1.0 - damped + warped**2) / scale
    before, start = 1.0, np.zeros((len(sections), 2))
    for own, (b0, b1, b2, _, a1, a2) in zip(start, sections, strict=True):
        after = before * (b0 + b1 + b2) / (1.0 + a1 + a2)
        own[:] = after - b0 * before, b2 * before - a2 * after
        before = after
    return sections, start


def smooth_nonperiodic(
    recording: Recording, cutoff_hz: float, torque_limit_hz: float | None = None
) -> SmoothedSignals:
    """Return a recording resampled from its time stamps, low-passed and differentiated.

    - Invalid rows are left out. A gap of more than 5 median steps divides the recording into
      segments.
    - Each segment loses 2 / `cutoff_hz` at both ends, at which the filter has no past or future. A
      segment shorter than 6 / `cutoff_hz` or than 10 median steps is left out.
    - Temperatures change slowly and in steps of their sensor, so they are interpolated linearly.
    - The signals before the low-pass are kept; see `UnfilteredSignals`.

    Args:
        cutoff_hz: -3 dB frequency of the zero-phase low-pass, for position and torque [Hz].
        torque_limit_hz: Cut-off of a low-pass for the unfiltered torque, if the torque is unknown
            above this frequency [Hz].

    Raises:
        ConfigError: The cut-off does not fit the sampling rate.
        DataQualityError: No segment is long enough.
    """
    time_s = recording.valid_rows("time_s")
    if len(time_s) < 2:
        raise DataQualityError(
            f"the recording has {len(time_s)} valid rows, but smoothing needs at least 2: record"
            " longer",
            code="RID-RECORDING-SHORT",
        )
    position, torque = recording.valid_rows("position"), recording.valid_rows("torque_nm")
    step_s = float(np.median(np.diff(time_s)))
    cuts = np.flatnonzero(np.diff(time_s) > GAP_STEPS * step_s) + 1
    width_s = smoothing_width(position, step_s)
    held = find_repeated_torques(position, torque)
    segments: list[_Segment] = []
    rough: list[_Segment] = []
    inner: list[IntArray] = []
    renewed: list[IntArray] = []
    edges = [0, *cuts.tolist(), len(time_s)]
    for rows in map(slice, edges, edges[1:]):
        stamps = time_s[rows]
        if stamps[-1] - stamps[0] < max(6.0 / cutoff_hz, 10.0 * step_s):
            continue
        grid = stamps[0] + step_s * np.arange(math.ceil(_steps(stamps[-1] - stamps[0], step_s)))
        edge = math.floor(_steps(2.0 / cutoff_hz, step_s)) + 1
        inside = slice(edge, len(grid) - edge)
        raw_position, raw_torque = (
            ColumnFile.of_columns(
                (spline_at(stamps, column[rows], grid) for column in each_column(values)),
                values.shape[1],
                len(grid),
            )
            for values in (position, torque)
        )
        before = sum(len(piece.time_s) for piece in rough)
        inner.append(np.arange(inside.start, inside.stop) + before)
        if held is not None:
            at = _rows_at(stamps, grid)
            own = np.maximum(held.update_row[rows][at] - rows.start, 0)
            raw_torque = np.take_along_axis(torque[rows], own, axis=0)
            renewed.append(before + _rows_at(grid, stamps)[own])
        motion = (raw_position, *quintic_derivatives(raw_position, step_s))
        if torque_limit_hz is not None:
            raw_torque = _low_passed(raw_torque, step_s, torque_limit_hz)
        signals = (smooth_gaussian(values, step_s, width_s) for values in (*motion, raw_torque))
        rough.append(_Segment(grid, *signals))
        smooth_position = _low_passed(raw_position, step_s, cutoff_hz)
        motion = (smooth_position, *quintic_derivatives(smooth_position, step_s))
        smooth_torque = _low_passed(raw_torque, step_s, cutoff_hz)
        signals = (values[inside] for values in (*motion, smooth_torque))
        segments.append(_Segment(grid[inside], *signals))
    if not segments:
        raise DataQualityError(
            f"no part of the recording is longer than {6.0 / cutoff_hz:.3g} s without a gap of"
            f" {GAP_STEPS * step_s * 1e3:.3g} ms: use a higher cut-off frequency, or a recording"
            " with fewer gaps",
            code="RID-RECORDING-CUTOFF",
        )
    joined = _join(segments)
    return SmoothedSignals(
        joint_names=recording.joint_names,
        **joined._asdict(),
        segment=stored(_numbers(segments)),
        sample_period_s=step_s,
        cutoff_hz=cutoff_hz,
        temperature_k=(
            None if recording.temperature_k is None else temperature_at(recording, joined.time_s)
        ),
        unfiltered=UnfilteredSignals(
            **_join(rough)._asdict(),
            segment=stored(_numbers(rough)),
            sample_period_s=step_s,
            smoothing_s=width_s,
            torque_limit_hz=torque_limit_hz,
            torque_row=np.concatenate(renewed) if renewed else None,
        ),
        unfiltered_row=stored(np.concatenate(inner)),
    )


def _rows_at(stamps: FloatArray, time_s: FloatArray) -> IntArray:
    """Return, for each time, the last row whose stamp is at most half a step later."""
    slack_s = 0.5 * float(np.median(np.diff(time_s)))
    return np.asarray(np.maximum(np.searchsorted(stamps, time_s + slack_s) - 1, 0))


def _join(segments: Sequence[_Segment]) -> _Segment:
    """Return the segments as one, with read-only arrays, which `freeze` does not copy."""
    return _Segment(*(stored_rows(parts) for parts in zip(*segments, strict=True)))


def _numbers(segments: Sequence[_Segment]) -> IntArray:
    """Return the segment number of each row."""
    return np.repeat(np.arange(len(segments)), [len(piece.time_s) for piece in segments])


def temperature_at(recording: Recording, time_s: FloatArray) -> FloatArray:
    """Return the drives' temperatures at other times, (times, joints); no columns if unknown."""
    if recording.temperature_k is None:
        return np.empty((len(time_s), 0))
    stamps, valid = recording.valid_rows("time_s"), recording.valid
    columns = (
        np.interp(time_s, stamps, joint[valid]) for joint in each_column(recording.temperature_k)
    )
    n = len(recording.joint_names)
    return lock(ColumnFile.of_columns(columns, n, len(time_s)))
