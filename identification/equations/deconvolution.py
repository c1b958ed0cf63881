"""Removal of the anti-alias filter's lag from a recording that is not periodic.

An 8th-order filter of 40 Hz delays the torque by 20 ms, enough to spoil a comparison with
unfiltered positions. For averaged periods the filter is divided out on the bins. Here it is divided
out of the whole recording, which is then low-passed far below the filter's cut-off.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals, smooth_nonperiodic
from acquisition.recording.recording import Recording
from acquisition.signals.bins import filter_response
from config.arrays import FloatArray
from config.cell.torque_filter import ButterworthFilter
from config.errors import EstimationError

MARGIN_PERIODS = 40.0
SMALLEST_GAIN = 1e-3
HIGHEST_SHARE = 0.44
"""Highest cut-off of the low-pass after the division, relative to the sampling frequency."""


def smoothed_recording(recording: Recording, cutoff_hz: float) -> SmoothedSignals:
    """Return the smoothed recording, with the torques' anti-alias filter divided out.

    Raises:
        ConfigError: The cut-off does not fit the sampling.
        DataQualityError: No segment is long enough.
        EstimationError: The torques passed a filter, but the time stamps are not uniform.
    """
    limit_hz = None
    if recording.torque_filter is not None and recording.sample_period_s is not None:
        highest_hz = HIGHEST_SHARE / recording.sample_period_s
        limit_hz = min(max(recording.torque_filter.cutoff_hz, cutoff_hz), highest_hz)
    return smooth_nonperiodic(without_torque_filter(recording), cutoff_hz, limit_hz)


def without_torque_filter(recording: Recording) -> Recording:
    """Return a recording with the anti-alias filter of the torques removed.

    High frequencies are amplified up to a thousandfold: low-pass the result. A recording whose
    torques passed no filter is returned unchanged.

    Raises:
        EstimationError: The time stamps are not uniform.
    """
    if recording.torque_filter is None:
        return recording
    if recording.sample_period_s is None:
        raise EstimationError(
            "the recording's torques passed an anti-alias filter, but its time stamps are not"
            " uniform, so the filter's effect cannot be removed: record with a constant sample"
            " period",
            code="RID-RECORDING-CLOCK",
        )
    torque = without_filter(recording.torque_nm, recording.sample_period_s, recording.torque_filter)
    return replace(recording, torque_nm=torque, torque_filter=None)


def without_filter(
    values: FloatArray, sample_period_s: float, passed: ButterworthFilter | None
) -> FloatArray:
    """Undo a filter: return the signals before it, from uniformly sampled signals (samples, any).

    High frequencies are amplified, as in `without_torque_filter`.
    """
    if passed is None:
        return values
    rows = len(values)
    margin = min(rows - 1, round(MARGIN_PERIODS / (passed.cutoff_hz * sample_period_s)))
    # Point-mirror the signals at both ends, so that the wrap-around step of the transform lies
    # in the margins.
    extended = np.concatenate(
        [
            2.0 * values[:1] - values[margin:0:-1],
            values,
            2.0 * values[-1:] - values[-2 : -margin - 2 : -1],
        ]
    )
    duration_s = len(extended) * sample_period_s
    frequency_hz = np.arange(len(extended) // 2 + 1) / duration_s
    response = filter_response(passed, frequency_hz)
    response /= np.minimum(
        1.0, np.abs(response) / SMALLEST_GAIN
    )  # amplify by at most 1 / SMALLEST_GAIN
    bins = np.fft.rfft(extended, axis=0) / response[:, np.newaxis]
    return np.asarray(np.fft.irfft(bins, n=len(extended), axis=0)[margin : margin + rows])
