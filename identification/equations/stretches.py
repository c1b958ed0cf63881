"""`smoothed_stretches`: stretches of long recordings, for comparisons that need no more data."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Final

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from acquisition.recording.recording import Recording
from config.errors import DataQualityError
from identification.equations.deconvolution import smoothed_recording

COMPARED_HZ: Final = 200.0
"""Sampling rate of the stretches [Hz]."""
COMPARED_S: Final = 120.0
"""Longest duration of all stretches together [s]."""
STRETCH_S: Final = 30.0
"""Duration of a stretch of a longer recording [s]."""


def smoothed_stretches(
    recordings: Sequence[Recording], band_hz: float
) -> list[list[SmoothedSignals]]:
    """Return recordings as low-passed signals, one list for each recording.

    Fast recordings are first thinned to a rate between `COMPARED_HZ` and twice this rate, unless a
    filter must be divided out of their torques.

    If the recordings last longer than `COMPARED_S` together, evenly spaced stretches of `STRETCH_S`
    are used. A stretch with too few samples, as in a gap, is left out.
    """
    total_s = sum(float(each.time_s[-1] - each.time_s[0]) for each in recordings)
    share = min(1.0, COMPARED_S / max(total_s, COMPARED_S))
    signals: list[list[SmoothedSignals]] = []
    for recording in recordings:
        signals.append([])
        for part in stretches(recording, share):
            with suppress(DataQualityError):
                signals[-1].append(smoothed_recording(_thinned_recording(part), band_hz))
    return signals


def stretches(recording: Recording, share: float) -> list[Recording]:
    """Return evenly spaced stretches of `STRETCH_S` that contain about a share of a recording.

    A stretch with less than two samples is left out.
    """
    since_s = recording.time_s - recording.time_s[0]
    count = math.ceil(share * since_s[-1] / STRETCH_S)
    if share == 1.0 or count * STRETCH_S >= since_s[-1]:
        return [recording]
    starts_s = since_s[-1] / count * np.arange(count)
    edges = np.searchsorted(since_s, [starts_s, starts_s + STRETCH_S]).T
    return [recording.part(slice(first, end)) for first, end in edges.tolist() if end - first > 1]


def _thinned_recording(recording: Recording) -> Recording:
    step_s = float(np.median(np.diff(recording.time_s)))
    every = max(1, int(1.0 / (COMPARED_HZ * step_s)))
    if every == 1 or recording.torque_filter is not None:
        return recording
    period_s = recording.sample_period_s
    return replace(
        recording.part(slice(None, None, every)),
        sample_period_s=None if period_s is None else every * period_s,
    )
