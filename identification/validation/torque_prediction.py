"""`Validation`: measured and predicted torque on a run that was not used for the fit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals, low_pass
from acquisition.processing.torque_channel import TorqueChannel
from acquisition.processing.unfiltered import UnfilteredSignals
from acquisition.recording.recording import Recording
from config.arrays import BoolArray, FloatArray, freeze
from config.errors import DataQualityError, EstimationError
from dynamics.model.memory import presliding_of_model
from dynamics.model.standstill import moving_actuators as moves
from dynamics.terms.conditions import Conditions
from identification.choices import BAND_HZ, STANDSTILL_RAD_S
from identification.elasticity.gear_torque import gear_torque
from identification.equations.deconvolution import smoothed_recording
from identification.equations.parallel_filter import ParallelFilter
from identification.estimation.estimate import Estimate, predict
from identification.regression.fit_grade import FitGrade, grade_fit, limit_share


@dataclass(frozen=True, eq=False)
class Validation:
    """Torque errors per joint, and the samples from which they were computed.

    Errors use only moving samples, those at or above `standstill_rad_s`. Below this speed, friction
    is stiction, which sign(v) does not describe. `all_samples_percent` uses all samples. Both leave
    out samples whose friction depends on motion before the recording or in a gap, because this
    motion is unknown.

    Attributes:
        joint_names: Joints from base to flange.
        time_s: Shape (samples,). Times of the rows [s].
        measured_nm, predicted_nm: Shape (samples, n). Torques, both below `cutoff_hz` [N m or N].
        position, velocity, acceleration: Shape (samples, n). The motion of the prediction [rad or
            m, per s, per s^2].
        moving: Shape (samples, n). True if the joint moves.
        known: Shape (samples, n). True if the joint's friction depends only on the recorded motion;
            always true without presliding.
        rms_nm: Shape (n,). RMS of measured minus predicted on the counted samples [N m or N]; NaN
            without any.
        relative_percent: Shape (n,). `rms_nm` relative to the RMS of the measured torque [%].
        all_samples_percent: Shape (n,). The relative error on every known sample, including
            standstill [%]; NaN without any.
        noise_nm: Shape (n,). RMS error below `cutoff_hz` due to the measurement noise alone, if it
            is known [N m or N].
        cutoff_hz, standstill_rad_s: Cut-off of the signals' low-pass, and lowest speed of the
            counted samples.
        limits_percent: The largest relative errors allowed.
        channel: Delay and filter that are applied to the predicted torque, those of the estimate's
            own recording.
        remembering: Joints with presliding, whose torque is also predicted at standstill and
            reversal.
        gears_nm: Shape (samples, n). Torque by which the deflection of elastic gears reduces the
            predicted torque [N m or N]; None for a model of rigid gears.
    """

    joint_names: tuple[str, ...]
    time_s: FloatArray
    measured_nm: FloatArray
    predicted_nm: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    moving: BoolArray
    known: BoolArray
    rms_nm: FloatArray
    relative_percent: FloatArray
    all_samples_percent: FloatArray
    noise_nm: FloatArray | None
    cutoff_hz: float
    standstill_rad_s: float
    limits_percent: tuple[float, ...] | None = None
    channel: TorqueChannel | None = None
    remembering: tuple[str, ...] = ()
    gears_nm: FloatArray | None = None

    def __post_init__(self) -> None:
        n = len(self.joint_names)
        freeze(self, EstimationError, (None, n), "measured_nm", "predicted_nm")
        if self.limits_percent is not None and len(self.limits_percent) != n:
            raise EstimationError(
                f"validation: {len(self.limits_percent)} limits are given for {n} joints: give"
                " one limit for each joint",
                code="RID-OPTION-COUNT",
            )

    @property
    def counted(self) -> BoolArray:
        """Mask of the samples in the errors, shape (samples, n)."""
        return np.asarray(self.moving & self.known)

    @property
    def counted_fraction(self) -> FloatArray:
        """Fraction of the samples in the errors, shape (n,)."""
        return np.asarray(self.counted.mean(axis=0))

    @property
    def torque_nm(self) -> FloatArray:
        """RMS of the measured torque on the counted samples, shape (n,) [N m or N]."""
        return _rms(self.measured_nm, self.counted)

    @property
    def fit(self) -> tuple[FitGrade, ...]:
        """Quality of the prediction of each joint's torque."""
        return grade_fit(self.joint_names, self.rms_nm, self.torque_nm, self.noise_nm)

    @property
    def default_limits_percent(self) -> tuple[float, ...]:
        """Relative errors above which a fit is bad, from the torque and its noise."""
        return tuple((100.0 * limit_share(self.torque_nm, self.noise_nm)).tolist())

    @property
    def gear_torque_nm(self) -> FloatArray | None:
        """RMS of `gears_nm` on the counted samples, shape (n,); None for a model of rigid gears."""
        return None if self.gears_nm is None else _rms(self.gears_nm, self.counted)

    @property
    def verdicts(self) -> tuple[bool | None, ...]:
        """True for each joint that satisfies its limit; None without a limit or a sample."""
        if self.limits_percent is None:
            return (None,) * len(self.joint_names)
        return tuple(
            None if np.isnan(error) else bool(error <= limit)
            for error, limit in zip(self.relative_percent, self.limits_percent, strict=True)
        )

    @property
    def passed(self) -> bool | None:
        """True if every joint that moves satisfies its limit; None without limits."""
        known = [verdict for verdict in self.verdicts if verdict is not None]
        return all(known) if known else None


def validate_torques(
    estimate: Estimate,
    recording: Recording,
    *,
    cutoff_hz: float = BAND_HZ,
    standstill_rad_s: float = STANDSTILL_RAD_S,
    limits_percent: tuple[float, ...] | None = None,
    noise_nm: FloatArray | None = None,
) -> Validation:
    """Predict the torques of a recording and compare them with the measured ones.

    Args:
        estimate: The identified robot. To validate other parameters, replace its `values` with
            `dataclasses.replace`. A model of the links behind elastic gears predicts the torques
            for the links' motion, which is computed from that of the motors.
        recording: Any motion; it is low-passed without phase shift, periodic or not. Its torque
            channel is assumed to be that of the estimate's recording (`Estimate.channel`).
        cutoff_hz: Cut-off of the low-pass for measured and predicted torque [Hz].
        standstill_rad_s: Samples of a joint slower than this are not used for this joint. If the
            torque has a delay, the joint must have moved when the torque acted.
        limits_percent: Largest relative error of each joint for the verdict.
        noise_nm: Shape (n,). Noise standard deviation of one torque sample, the square root of
            `PeriodAverage.torque_variance`.

    Raises:
        EstimationError: The recording's joints are not those of the estimate.
        DataQualityError: Nothing moves in the recording, or nothing moves far enough for its
            friction to be known.
    """
    names = estimate.robot.joint_names
    if recording.joint_names != names:
        raise EstimationError(
            f"the recording has joints {', '.join(recording.joint_names)}, but the estimate has"
            f" {', '.join(names)}: use a model of this robot",
            code="RID-ROBOT-OTHER",
        )
    signals = smoothed_recording(recording, cutoff_hz)
    if estimate.channel is not None:
        signals = replace(signals, channel=estimate.channel)
    if estimate.warming is not None:
        signals = estimate.warming.with_temperatures(estimate.robot, signals)
    filtered = ParallelFilter(signals)
    warmth = Conditions(temperature_k=signals.temperature_k)
    conditions = filtered.conditions(estimate.model, warmth)
    predicted = _predict_filtered(estimate, filtered, conditions, standstill_rad_s)
    gears = None
    if estimate.gear_torque_nm is not None:
        gears = _filter_torque(filtered, _gear_torques(estimate, filtered.source))
        predicted -= gears
    moving = _moving_when_torque_acted(
        moves(estimate.model, signals.velocity, standstill_rad_s), signals
    )
    if not moving.any():
        raise DataQualityError(
            f"no joint of the recording moves at {standstill_rad_s:g} rad/s (m/s) or more, so there"
            " is nothing to validate: use a recording with motion",
            code="RID-RUN-STILL",
        )
    known = _friction_known_rows(signals, conditions)
    if not (moving & known).any():
        raise DataQualityError(
            "no joint of the recording moves far enough for its presliding friction to be known,"
            " so there is nothing to validate: use a recording with larger motion",
            code="RID-RUN-STILL",
        )
    error, counted = signals.torque_nm - predicted, moving & known
    passband = min(1.0, 2.0 * cutoff_hz * signals.sample_period_s)
    return Validation(
        joint_names=names,
        time_s=signals.time_s,
        measured_nm=signals.torque_nm,
        predicted_nm=predicted,
        position=signals.position,
        velocity=signals.velocity,
        acceleration=signals.acceleration,
        moving=moving,
        known=known,
        rms_nm=_rms(error, counted),
        relative_percent=100.0 * _rms(error, counted) / _rms(signals.torque_nm, counted),
        all_samples_percent=100.0 * _rms(error, known) / _rms(signals.torque_nm, known),
        noise_nm=None if noise_nm is None else np.asarray(noise_nm) * np.sqrt(passband),
        cutoff_hz=cutoff_hz,
        standstill_rad_s=standstill_rad_s,
        limits_percent=limits_percent,
        channel=estimate.channel,
        remembering=tuple(names[own.joint] for own in presliding_of_model(estimate.model)),
        gears_nm=gears,
    )


def pool_validations(
    validations: Sequence[Validation], limits_percent: tuple[float, ...] | None
) -> Validation:
    """Return the errors of several recordings together, each sample with the same weight.

    Nothing is filtered or differentiated across the recordings. Their samples follow each other,
    with the times of each recording.

    Args:
        validations: Predictions of one model, at least one.
        limits_percent: Largest relative error of each joint on all recordings together.

    Returns:
        The noise is the RMS of the recordings' noise on the counted samples; it is unknown if that
        of one recording is.
    """
    measured, predicted, position, velocity, acceleration = (
        np.concatenate([getattr(each, name) for each in validations])
        for name in ("measured_nm", "predicted_nm", "position", "velocity", "acceleration")
    )
    moving, known = (
        np.concatenate([getattr(each, name) for each in validations])
        for name in ("moving", "known")
    )
    error, counted = measured - predicted, moving & known
    noise: FloatArray | None = None
    levels = [each.noise_nm for each in validations if each.noise_nm is not None]
    if len(levels) == len(validations):
        of_rows = [
            np.broadcast_to(level, each.counted.shape)
            for level, each in zip(levels, validations, strict=True)
        ]
        noise = _rms(np.concatenate(of_rows), counted)
    return replace(
        validations[0],
        time_s=np.concatenate([each.time_s for each in validations]),
        measured_nm=measured,
        predicted_nm=predicted,
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        moving=moving,
        known=known,
        rms_nm=_rms(error, counted),
        relative_percent=100.0 * _rms(error, counted) / _rms(measured, counted),
        all_samples_percent=100.0 * _rms(error, known) / _rms(measured, known),
        noise_nm=noise,
        limits_percent=limits_percent,
        gears_nm=None
        if validations[0].gears_nm is None
        else np.concatenate([each.gears_nm for each in validations if each.gears_nm is not None]),
    )


def common_relative_errors(one: Validation, other: Validation) -> FloatArray:
    """Return the relative errors of two predictions on their common samples, (2, n) [%].

    Args:
        one, other: Predictions of one recording.
    """
    times = np.intersect1d(one.time_s, other.time_s)
    rows = [np.isin(each.time_s, times) for each in (one, other)]
    counted = one.counted[rows[0]] & other.counted[rows[1]]
    return np.array(
        [
            100.0
            * _rms((each.measured_nm - each.predicted_nm)[use], counted)
            / _rms(each.measured_nm[use], counted)
            for each, use in zip((one, other), rows, strict=True)
        ]
    )


def _moving_when_torque_acted(moving: BoolArray, signals: SmoothedSignals) -> BoolArray:
    """Return a mask (samples, n): the joint moves, and moved when the recorded torque acted.

    If the recorded torque is delayed, the first samples of a joint that starts to move still
    contain the torque at rest.
    """
    seen = moving.copy()
    if signals.channel is None:
        return seen
    late_s = signals.channel.delay_s + signals.channel.lag_s
    for j, rows in enumerate(np.round(late_s / signals.sample_period_s).astype(int).tolist()):
        for shift in range(1, abs(rows) + 1):
            after, before = seen[shift:, j], moving[:-shift, j]
            if rows < 0:
                after, before = seen[:-shift, j], moving[shift:, j]
            after &= before
    return seen


def _predict_filtered(
    estimate: Estimate,
    filtered: ParallelFilter,
    conditions: Conditions,
    standstill_rad_s: float,
) -> FloatArray:
    """Return the torques of the signals' rows, filtered like the measured ones, (samples, n).

    The prediction uses the unfiltered velocity, because a low-passed velocity changes its sign at a
    wrong time. At standstill it uses the low-passed velocity, because there the sign of the
    unfiltered velocity is noise.
    """
    source, signals = filtered.source, filtered.signals
    velocity = source.velocity.copy()
    for number in np.unique(source.segment):
        rows = source.segment == number
        velocity[rows] = low_pass(velocity[rows], source.sample_period_s, signals.cutoff_hz)
    fast = moves(estimate.model, source.velocity, standstill_rad_s)
    velocity[fast] = source.velocity[fast]
    if estimate.model.transmission.losses:
        load = filtered.whole_load_nm(estimate.model, estimate.standard_values, conditions)
        conditions = replace(conditions, load_nm=load)
    torque = predict(estimate, source.position, velocity, source.acceleration, conditions)
    return _filter_torque(filtered, torque)


def _gear_torques(estimate: Estimate, source: SmoothedSignals | UnfilteredSignals) -> FloatArray:
    """Return the torque that rigid gears would need more, at the source's rows, (samples, n)."""
    torque = np.empty_like(source.position)
    for number in np.unique(source.segment):
        rows = source.segment == number
        torque[rows] = gear_torque(estimate, source.position[rows], source.sample_period_s)
    return torque


def _filter_torque(filtered: ParallelFilter, torque: FloatArray) -> FloatArray:
    """Return a torque of the source's rows at the signals' rows, filtered like the measured one."""
    source, signals = filtered.source, filtered.signals
    for number in np.unique(source.segment):
        rows = source.segment == number
        if signals.channel is not None:
            torque[rows] = signals.channel.through(torque[rows], source.sample_period_s)
    if isinstance(source, UnfilteredSignals) and source.torque_row is not None:
        torque = np.take_along_axis(torque, source.torque_row, axis=0)
    for number in np.unique(source.segment):
        rows = source.segment == number
        torque[rows] = low_pass(torque[rows], source.sample_period_s, signals.cutoff_hz)
    return torque if signals.unfiltered_row is None else torque[signals.unfiltered_row]


def _friction_known_rows(signals: SmoothedSignals, conditions: Conditions) -> BoolArray:
    """Return a mask of samples whose friction depends only on recorded motion, (samples, n).

    Unknown friction affects later samples through the low-pass and the channel: for one period of
    the cut-off, and for the duration of the channel's response.
    """
    memory, found = conditions.memory, np.ones(signals.position.shape, dtype=bool)
    if memory is not None:
        channel_s = 0.0 if signals.channel is None else float(signals.channel.after_s.max())
        source = ParallelFilter(signals).source
        rows = math.ceil((1.0 / signals.cutoff_hz + channel_s) / source.sample_period_s)
        known = memory.known_through(source.segment, rows)
        kept = slice(None) if signals.unfiltered_row is None else signals.unfiltered_row
        found[:, list(memory.joints)] = known[kept]
    return found


def _rms(values: FloatArray, use: BoolArray) -> FloatArray:
    """Return the RMS of each column over the used rows; NaN for a column without used rows."""
    rows = use.sum(axis=0)
    total = np.sum(np.square(values) * use, axis=0)
    return np.asarray(np.sqrt(np.where(rows > 0, total / np.maximum(rows, 1), np.nan)))
