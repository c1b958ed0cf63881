"""`BaseWrenchValidation`: measured and predicted base wrench on a run not used for the fit.

A plate's offset and slow drift contain no information on the robot, and the delay of its signals
belongs to the measurement chain. All three are estimated from the run itself and removed, as in the
estimation of a model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals, low_pass, smooth_nonperiodic
from acquisition.recording.plate_geometry import WRENCH_NAMES
from acquisition.recording.recording import Recording
from config.arrays import BoolArray, FloatArray, freeze
from config.errors import DataQualityError, EstimationError
from dynamics.terms.conditions import Conditions
from identification.choices import BAND_HZ
from identification.equations.deconvolution import without_filter
from identification.equations.plate_fit import SMALL_COMPONENT
from identification.estimation.estimate import Estimate, predict_base_wrench
from identification.regression.fit_grade import BAD_SHARE

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

STEPS = 4
MOTION_CUTOFFS = 1.5
HIGHEST_SHARE = 0.3
EDGE_CUTOFFS = 2.0


@dataclass(frozen=True, eq=False)
class BaseWrenchValidation:
    """Errors of the predicted base wrench, component by component.

    Attributes:
        time_s: Shape (samples,). Times of the rows [s].
        measured, predicted: Shape (samples, 6). Base wrench below `cutoff_hz`, without constant
            part, and without drift of the measured one [N, N m].
        counted: Shape (samples,). True if every channel of the plate was valid.
        rms: Shape (6,). RMS of measured minus predicted [N, N m].
        relative_percent: Shape (6,). `rms` relative to the RMS of the measured wrench around its
            mean [%].
        noise: Shape (6,). RMS error below `cutoff_hz` due to noise alone, from the periods of the
            model's identification [N, N m].
        delay_s: Delay of the plate's signals [s].
        cutoff_hz: Cut-off of the low-pass of all signals [Hz].
    """

    time_s: FloatArray
    measured: FloatArray
    predicted: FloatArray
    counted: BoolArray
    rms: FloatArray
    relative_percent: FloatArray
    noise: FloatArray | None
    delay_s: float
    cutoff_hz: float

    def __post_init__(self) -> None:
        freeze(self, EstimationError, (None, 6), "measured", "predicted")

    @property
    def limit_percent(self) -> FloatArray:
        """Largest relative error of each component for a passed verdict, shape (6,) [%].

        As for torques, it is `BAD_SHARE` of the component, combined with the noise. A small
        component counts as `SMALL_COMPONENT` of the largest force or moment.
        """
        size = np.maximum(100.0 * self.rms / np.maximum(self.relative_percent, 1e-12), 1e-12)
        counted = size.copy()
        for part in (slice(0, 3), slice(3, 6)):
            counted[part] = np.maximum(size[part], SMALL_COMPONENT * size[part].max())
        noise = np.zeros(6) if self.noise is None else self.noise
        return np.asarray(100.0 * np.hypot(BAD_SHARE * counted, noise) / size)

    @property
    def sentence(self) -> str:
        """The errors of the base wrench and the plate's delay, in one sentence."""
        errors = ", ".join(
            f"{name} {rms:.3g} ({share:.2g} %)"
            for name, rms, share in zip(WRENCH_NAMES, self.rms, self.relative_percent, strict=True)
        )
        return (
            f"Base wrench below {self.cutoff_hz:g} Hz, RMS error [N, N m]: {errors}; the plate's"
            f" signals were {1e3 * self.delay_s:.2f} ms late."
        )


def validate_base_wrench(
    estimate: Estimate, recording: Recording, *, cutoff_hz: float = BAND_HZ
) -> BaseWrenchValidation:
    """Predict the base wrench of a recording and compare it with the measured one.

    Args:
        estimate: Estimate of the external or the combined model.
        recording: Any motion, with a force plate; it is low-passed without phase shift.
        cutoff_hz: Cut-off of the low-pass [Hz].

    Raises:
        EstimationError: The joints are not those of the estimate, or it is of the internal model.
        DataQualityError: The recording has no force plate or no uniform time stamps, or no interval
            of valid rows is long enough.
    """
    if recording.joint_names != estimate.robot.joint_names:
        raise EstimationError(
            f"the recording has joints {', '.join(recording.joint_names)}, but the estimate has"
            f" {', '.join(estimate.robot.joint_names)}: use a model of this robot",
            code="RID-ROBOT-OTHER",
        )
    step_s = float(np.median(np.diff(recording.time_s)))
    # Products of angles and accelerations above the cut-off contribute below the cut-off.
    motion_hz = max(cutoff_hz, min(MOTION_CUTOFFS * cutoff_hz, HIGHEST_SHARE / step_s))
    signals = smooth_nonperiodic(recording, motion_hz)
    curve, counted = _measured_wrench(recording, signals, cutoff_hz)
    conditions = Conditions(temperature_k=signals.temperature_k)
    predicted = predict_base_wrench(
        estimate, signals.position, signals.velocity, signals.acceleration, conditions
    )
    slope = np.zeros_like(predicted)
    for number in np.unique(signals.segment):
        rows = signals.segment == number
        predicted[rows] = low_pass(predicted[rows], signals.sample_period_s, cutoff_hz)
        slope[rows] = np.gradient(predicted[rows], signals.sample_period_s, axis=0)
    predicted = predicted - predicted[counted].mean(axis=0)
    measured, delay_s = _remove_delay_and_drift(curve, signals.time_s, predicted, slope, counted)
    error = (measured - predicted)[counted]
    rms = np.sqrt(np.mean(error**2, axis=0))
    size = np.std(measured[counted], axis=0)
    noise = None
    if estimate.plate is not None:
        periods = estimate.periods / max(len(estimate.plate.left_out), 1)
        noise = estimate.plate.noise * np.sqrt(periods * cutoff_hz / estimate.band_hz)
    return BaseWrenchValidation(
        time_s=signals.time_s,
        measured=measured,
        predicted=predicted,
        counted=counted,
        rms=rms,
        relative_percent=100.0 * rms / size,
        noise=noise,
        delay_s=delay_s,
        cutoff_hz=cutoff_hz,
    )


def pool_base_wrenches(parts: Sequence[BaseWrenchValidation]) -> BaseWrenchValidation:
    """Return the errors of several recordings together, each counted sample with the same weight.

    Args:
        parts: Comparisons of one model with each recording, at least one.

    Returns:
        The size of a component is the RMS around the mean of its own recording, the delay the mean
        of the delays. The noise is unknown if that of one recording is.
    """
    counts = np.array([np.count_nonzero(each.counted) for each in parts], dtype=float)

    def pooled(values: Sequence[FloatArray]) -> FloatArray:
        return np.asarray(np.sqrt(counts @ np.square(values) / counts.sum()))

    rms = pooled([each.rms for each in parts])
    size = pooled([100.0 * each.rms / each.relative_percent for each in parts])
    noises = [each.noise for each in parts if each.noise is not None]
    return replace(
        parts[0],
        time_s=np.concatenate([each.time_s for each in parts]),
        measured=np.concatenate([each.measured for each in parts]),
        predicted=np.concatenate([each.predicted for each in parts]),
        counted=np.concatenate([each.counted for each in parts]),
        rms=rms,
        relative_percent=100.0 * rms / size,
        noise=pooled(noises) if len(noises) == len(parts) else None,
        delay_s=float(np.mean([each.delay_s for each in parts])),
    )


def _measured_wrench(
    recording: Recording, signals: SmoothedSignals, cutoff_hz: float
) -> tuple[CubicSpline, BoolArray]:
    """Return the low-passed wrench as a function of time, and a mask of the valid smoothed rows."""
    from scipy.interpolate import CubicSpline  # a slow import that few commands need

    reaction, step_s = recording.reaction, recording.sample_period_s
    if reaction is None:
        raise DataQualityError(
            "the recording has no force plate signals, so no base wrench can be compared: record"
            " with a force plate",
            code="RID-PLATE-MISSING",
        )
    if step_s is None:
        raise DataQualityError(
            "the recording's time stamps are not uniform, so the plate cannot be used: record"
            " with a constant sample period",
            code="RID-RECORDING-CLOCK",
        )
    valid: BoolArray = np.asarray(reaction.valid.all(axis=1))
    if valid.mean() < 0.5:
        worst = reaction.channel_names[int(np.argmin(reaction.valid.mean(axis=0)))]
        raise DataQualityError(
            f"the force plate is valid on only {valid.mean():.0%} of the rows (worst channel"
            f" {worst}): select a larger range, or check the channel's cable",
            code="RID-PLATE-CHANNEL",
        )
    good = np.flatnonzero(valid)
    nearest = good[np.clip(np.searchsorted(good, np.arange(len(valid))), 0, len(good) - 1)]
    wrench = without_filter(reaction.base_wrench[nearest], step_s, reaction.low_pass)
    curve = CubicSpline(recording.time_s, low_pass(wrench, step_s, cutoff_hz))
    row = np.searchsorted(recording.time_s, signals.time_s)
    bad = np.concatenate([[0], np.cumsum(~valid)])
    edge = round(EDGE_CUTOFFS / cutoff_hz / step_s)
    first, last = np.maximum(row - edge, 0), np.minimum(row + edge + 1, len(valid))
    counted = bad[last] == bad[first]
    if counted.sum() < 2 * edge:
        raise DataQualityError(
            "no interval of valid force plate rows is long enough: record again, and check the"
            " range of the channels",
            code="RID-PLATE-CHANNEL",
        )
    return curve, counted


def _remove_delay_and_drift(
    curve: CubicSpline,
    time_s: FloatArray,
    predicted: FloatArray,
    slope: FloatArray,
    counted: BoolArray,
) -> tuple[FloatArray, float]:
    """Return the measured wrench without delay, offset and drift, and the delay [s]."""
    x = np.column_stack([np.ones(len(time_s)), time_s - time_s.mean()])
    delay_s, weights = 0.0, np.ones(6)
    measured = np.asarray(curve(time_s))
    weights = 1.0 / np.maximum(np.std(predicted[counted], axis=0), 1e-12)
    for _ in range(STEPS):
        measured = np.asarray(curve(time_s + delay_s))
        error = measured - predicted
        trend = np.linalg.lstsq(x[counted], error[counted], rcond=None)[0]
        error = error - x @ trend
        late = slope - x @ np.linalg.lstsq(x[counted], slope[counted], rcond=None)[0]
        # A signal with the delay d has the error -d times its slope.
        top = np.sum(weights**2 * (error * late)[counted])
        delay_s -= float(top / np.sum(weights**2 * (late * late)[counted]))
        weights = 1.0 / np.maximum(np.std(error[counted], axis=0), 1e-12)
    measured = np.asarray(curve(time_s + delay_s))
    trend = np.linalg.lstsq(x[counted], (measured - predicted)[counted], rcond=None)[0]
    return measured - x @ trend, delay_s
