"""`find_missing_effects`: effects that an estimate lacks, although its runs show them."""

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
from identification.elasticity.elastic_fit import rigid_averages
from identification.equations.deconvolution import smoothed_recording
from identification.equations.late_torques import find_late_torques
from identification.equations.segments import period_signals
from identification.estimation.estimate import Estimate
from identification.validation.further_terms import further_term_findings
from identification.validation.model_choice import ModelChoice
from identification.validation.torque_filters import channel_findings
from rid_daq.operations.estimation.run_estimation import EstimationJob, period_averages
from rid_daq.runs.run_data import RunData

COMPARED_HZ: Final = 200.0
"""Sampling rate for the search for effects that the model lacks [Hz]."""
COMPARED_S: Final = 300.0
"""Longest duration of the recordings in this search [s]."""
STRETCH_S: Final = 30.0
"""Duration of a stretch of a longer recording in this search [s]."""


def find_missing_effects(
    estimate: Estimate,
    data: Sequence[RunData],
    how: EstimationJob,
    comparison: ModelChoice | None,
) -> tuple[list[str], tuple[str, ...]]:
    """Return findings on effects that an estimate lacks, and the joints whose torques are late.

    Args:
        comparison: The model chosen by `--choose`; None without it.
    """
    coarse = _coarse_signals(estimate, data, how)
    if not coarse:
        return [], ()
    options = how.options
    channel = None if comparison is None else comparison.channel
    late = find_late_torques(
        estimate.robot, coarse, options.model, options.standstill_rad_s, channel
    )
    findings: list[str] = []
    if comparison is None:
        findings += further_term_findings(estimate.robot, coarse, options)
    findings += [each.sentence for each in late]
    joints = tuple(each.joint for each in late)
    is_clock_known = all(item.clock is None or item.clock.is_known for item in data)
    can_show_channel = is_clock_known and not data[0].is_periodic and not how.has_rounded_positions
    if comparison is None and can_show_channel:
        findings += channel_findings(estimate.robot, coarse, options, joints)
    return findings, joints


def _coarse_signals(
    estimate: Estimate, data: Sequence[RunData], how: EstimationJob
) -> list[SmoothedSignals]:
    """Return runs as low-passed signals, to compare an estimate with richer models.

    The result is empty for runs with a payload, without torques in the model, or with a joint at
    rest.
    """
    if how.loaded or how.bodies or how.options.model.kind != "internal" or estimate.still:
        return []
    if data[0].is_periodic:
        averages = rigid_averages(estimate, period_averages(data))
        return [period_signals(average, how.options.band_hz) for average in averages]
    return smoothed_stretches([item.recording for item in data], how.options.band_hz)


def smoothed_stretches(recordings: Sequence[Recording], band_hz: float) -> list[SmoothedSignals]:
    """Return recordings as low-passed signals, thinned to `COMPARED_HZ` or a slightly higher rate.

    If they last longer than `COMPARED_S` together, evenly spaced stretches of `STRETCH_S` are used.
    A stretch with too few samples, as in a gap, is left out.
    """
    total_s = sum(float(each.time_s[-1] - each.time_s[0]) for each in recordings)
    share = min(1.0, COMPARED_S / max(total_s, COMPARED_S))
    signals: list[SmoothedSignals] = []
    for recording in recordings:
        for part in stretches(recording, share):
            with suppress(DataQualityError):
                signals.append(smoothed_recording(_thinned_recording(part), band_hz))
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
