"""Errors of a model on another run, by joint: their accuracy and their causes.

`validate` low-passes the torques at 10 Hz and counts every row at which a joint moves. Three
figures show what the error on these rows contains:
- `sigma_percent`: the standard deviation of the error. A run is short, and its neighbouring rows
  are alike.
- `away_percent`: the error at 7.5 Hz, on rows away from standstill. The friction of a joint at
  rest is unknown, and the low-pass spreads it to rows next to the rest.
- `own_friction_percent`: the error if the judged run itself determines the friction coefficients.
  The difference is friction that changed between the runs, as by temperature.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline

from acquisition.processing.smoothing import SmoothedSignals
from acquisition.processing.unfiltered import UnfilteredSignals, window_mean
from acquisition.recording.recording import Recording
from config.arrays import BoolArray, FloatArray
from dynamics.terms.conditions import Conditions
from identification.choices import BAND_HZ, STANDSTILL_RAD_S
from identification.equations.deconvolution import smoothed_recording
from identification.equations.parallel_filter import ParallelFilter
from identification.estimation.estimate import Estimate, predict
from identification.validation.channel_choice import AFTER_STANDSTILL_S
from identification.validation.torque_prediction import Validation, validate_torques

BLOCK_S: Final = 1.0
WINDOW_S: Final = 0.096
"""Length of the Hann window of `away_percent` [s]."""
LOW_PASS_HZ: Final = 0.72 / WINDOW_S
"""Frequency at which the gain of this window is -3 dB [Hz]."""
FINE_S: Final = 1e-3
"""Time between the rows to which the window is applied [s]; recordings are coarse for it."""


@dataclass(frozen=True, eq=False)
class JudgedErrors:
    """Relative errors of each joint on one run, shape (n,) each [%].

    Attributes:
        moving_percent: On the rows that `validate` counts.
        sigma_percent: Standard deviation of `moving_percent`, from leaving out each second in turn.
        away_percent: On rows away from standstill; NaN for a joint without such rows.
        own_friction_percent: On the rows that `validate` counts, with the coefficients of the
            joint's friction fitted to these rows.
    """

    moving_percent: FloatArray
    sigma_percent: FloatArray
    away_percent: FloatArray
    own_friction_percent: FloatArray


def judge_rows(estimate: Estimate, recording: Recording) -> JudgedErrors:
    """Compute the errors of a model on a run that was not used for its fit.

    Args:
        estimate: The model.
        recording: The run.
    """
    judged = validate_torques(estimate, recording)
    return JudgedErrors(
        judged.relative_percent,
        _sigma_percent(judged),
        _away_percent(estimate, recording),
        _own_friction_percent(estimate, recording, judged),
    )


def _sigma_percent(judged: Validation) -> FloatArray:
    """Return the standard deviation of each joint's relative error by a jackknife."""
    block = np.floor((judged.time_s - judged.time_s[0]) / BLOCK_S)
    squares = np.stack([judged.measured_nm - judged.predicted_nm, judged.measured_nm]) ** 2
    squares *= judged.counted
    parts = np.array([squares[:, block == each].sum(axis=1) for each in np.unique(block)])
    error, torque = np.moveaxis(parts.sum(axis=0) - parts, 1, 0)
    left = 100.0 * np.sqrt(error / torque)
    spread = np.sum((left - judged.relative_percent) ** 2, axis=0)
    return np.asarray(np.sqrt((len(parts) - 1) / len(parts) * spread))


def _away_percent(estimate: Estimate, recording: Recording) -> FloatArray:
    """Return the relative error of each joint on rows away from standstill."""
    signals = replace(smoothed_recording(recording, BAND_HZ), channel=estimate.channel)
    if estimate.warming is not None:
        signals = estimate.warming.with_temperatures(estimate.robot, signals)
    filtered = ParallelFilter(signals)
    source = filtered.source
    warmth = Conditions(temperature_k=signals.temperature_k)
    conditions = filtered.conditions(estimate.model, warmth)
    predicted = predict(estimate, *filtered.motion(slice(None)), conditions)
    if signals.channel is not None:
        for number in np.unique(source.segment):
            rows = source.segment == number
            predicted[rows] = signals.channel.through(predicted[rows], source.sample_period_s)
    if isinstance(source, UnfilteredSignals) and source.torque_row is not None:
        predicted = np.take_along_axis(predicted, source.torque_row, axis=0)
    both = np.hstack([source.torque_nm, predicted])
    low_passed = np.empty((len(signals), both.shape[1]))
    for number in np.unique(signals.segment):
        rows, wanted = (np.flatnonzero(own.segment == number) for own in (source, signals))
        curve = CubicSpline(source.time_s[rows], both[rows])
        time_s = signals.time_s[wanted]
        fine_s = np.arange(time_s[0] - WINDOW_S, time_s[-1] + WINDOW_S, FINE_S)
        places = np.searchsorted(fine_s, time_s)
        low_passed[wanted] = window_mean(curve(fine_s), places, FINE_S, LOW_PASS_HZ)
    measured, predicted = np.hsplit(low_passed, 2)
    _, moves = filtered.usable_rows(estimate.model, conditions, STANDSTILL_RAD_S)
    clear = ~_near_rest(signals, ~moves)
    error = np.sum((measured - predicted) ** 2 * clear, axis=0)
    total = np.sum(measured**2 * clear, axis=0)
    return np.asarray(100.0 * np.sqrt(error / np.where(total > 0.0, total, np.nan)))


def _near_rest(signals: SmoothedSignals, still: BoolArray) -> BoolArray:
    """Return a mask (samples, n) of the rows whose filtered torque depends on a rest.

    The low-pass spreads the torque at rest to earlier and later rows, and the filter of a drive to
    later ones.
    """
    reach_s = WINDOW_S / 2.0
    near = still.copy()
    for number in np.unique(signals.segment):
        rows = np.flatnonzero(signals.segment == number)
        time_s = signals.time_s[rows]
        first = np.searchsorted(time_s, time_s - reach_s - AFTER_STANDSTILL_S)
        last = np.searchsorted(time_s, time_s + reach_s, side="right")
        counts = np.cumsum(np.vstack([np.zeros_like(still[:1]), still[rows]]), axis=0)
        near[rows] = counts[last] > counts[first]
    return near


def _own_friction_percent(
    estimate: Estimate, recording: Recording, judged: Validation
) -> FloatArray:
    """Return the relative error of each joint with friction coefficients of the judged rows."""
    found = np.empty(len(judged.joint_names))
    for j, joint in enumerate(judged.joint_names):
        rows = judged.counted[:, j]
        error = (judged.measured_nm - judged.predicted_nm)[rows, j]
        columns = []
        for k, name in enumerate(estimate.base.names):
            if name.endswith(f"_{joint}"):
                values = estimate.values.copy()
                values[k] = 0.0
                without = validate_torques(replace(estimate, values=values), recording)
                columns.append((judged.predicted_nm - without.predicted_nm)[rows, j])
        if columns:
            change = np.stack(columns, axis=1)
            error -= change @ np.linalg.lstsq(change, error, rcond=None)[0]
        torque = np.sum(judged.measured_nm[rows, j] ** 2)
        found[j] = 100.0 * np.sqrt(np.sum(error**2) / torque)
    return found
