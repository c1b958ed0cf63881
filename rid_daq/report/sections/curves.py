"""Curves of a report: torque over time, residuals over frequency, and traces of a recording."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Annotated, Final

import numpy as np
from pydantic import Strict

from acquisition.recording.recording import Recording, concatenate_recordings
from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from rid_daq.report.sections.section import (
    Numbers,
    Section,
    finite_or_none,
    round_values,
    thinning_slice,
)

if TYPE_CHECKING:
    from identification.estimation.estimate import Estimate
    from identification.validation.period_comparison import PeriodComparison
    from identification.validation.torque_prediction import Validation


TRACE_STEPS: Final = 400
"""Largest number of steps of a trace; a step has the lowest and the highest value of its rows."""


class TorqueCurve(Section):
    """Measured and predicted torque of an axis, one value per time, in `unit`.

    Attributes:
        joint: Name of the joint.
        unit: Unit of the torque.
        caption: The size of the error, in words.
        measured: Measured torque.
        predicted: Predicted torque.
        counted: 1 for a sample that counts for the error; 0 for a sample at standstill, or with
            unknown friction.
    """

    joint: str
    unit: str
    caption: str
    measured: Numbers
    predicted: Numbers
    counted: Annotated[tuple[int, ...], Strict(False)]


class TorqueCurves(Section):
    """Torque over time.

    Attributes:
        sentence: Description of the curves.
        time_s: Times of the samples [s].
        axes: Curves of each axis.
    """

    sentence: str
    time_s: Numbers
    axes: tuple[TorqueCurve, ...]

    @classmethod
    def of(cls, validation: Validation, robot: RobotDescription) -> TorqueCurves:
        """Return measured and predicted torque of a validation, and the samples that count."""
        rows = thinning_slice(len(validation.time_s))
        axes = []
        unknown = "" if validation.known.all() else ", or its friction is not known yet"
        for i, joint in enumerate(robot.joints):
            error, share = (
                finite_or_none(validation.rms_nm[i]),
                finite_or_none(validation.relative_percent[i]),
            )
            unit = joint.torque_unit
            caption = "no sample counts"
            if error is not None and share is not None:
                caption = f"RMS error (counted) {error:.3g} {unit}, {share:.3g} %"
            axes.append(
                TorqueCurve(
                    joint=joint.name,
                    unit=unit,
                    caption=caption,
                    measured=round_values(validation.measured_nm[rows, i]),
                    predicted=round_values(validation.predicted_nm[rows, i]),
                    counted=tuple(map(int, validation.counted[rows, i])),
                )
            )
        return cls(
            sentence=f"Grey samples do not count: the joint is at standstill{unknown}. Each RMS"
            " value is computed from the other samples; percentages are relative to"
            " their RMS torque.",
            time_s=round_values(validation.time_s[rows] - validation.time_s[0], 7),
            axes=tuple(axes),
        )

    @classmethod
    def of_period(
        cls, estimate: Estimate, comparison: PeriodComparison, periods: int
    ) -> TorqueCurves:
        """Return measured and fitted torque of a mean period.

        Args:
            periods: Number of averaged periods.
        """
        rows = thinning_slice(len(comparison.time_s))
        axes = []
        for i, joint in enumerate(estimate.robot.joints):
            unit, counted = joint.torque_unit, comparison.counted[:, i]
            left = (comparison.measured_nm - comparison.fitted_nm)[counted, i]
            caption = "no sample counts"
            if counted.any():
                caption = f"RMS residual (counted) {np.sqrt(np.mean(left**2)):.3g} {unit}"
            axes.append(
                TorqueCurve(
                    joint=joint.name,
                    unit=unit,
                    caption=caption,
                    measured=round_values(comparison.measured_nm[rows, i]),
                    predicted=round_values(comparison.fitted_nm[rows, i]),
                    counted=tuple(map(int, comparison.counted[rows, i])),
                )
            )
        of_run = "" if len(estimate.run_ids) < 2 else " of the first run"
        return cls(
            sentence=f"Mean of {periods} periods{of_run}, up to {comparison.frequency_hz[-1]:.3g}"
            " Hz, to which the model was fitted. Grey samples do not count: they are slower than"
            f" {estimate.standstill_rad_s:g} rad/s, or presliding friction is not known yet; the"
            " fit does not use the torque there. Each RMS value is computed from the other"
            " samples. The residual in the table of the estimate covers the whole period and all"
            " runs.",
            time_s=round_values(comparison.time_s[rows], 7),
            axes=tuple(axes),
        )


class SpectrumCurve(Section):
    """RMS torque of an axis at each harmonic.

    Attributes:
        joint: Name of the joint.
        measured_nm: RMS of the measured torque, in `unit`.
        residual_nm: RMS of the residual, in `unit`.
        noise_nm: RMS of the noise, in `unit`.
        unit: Unit of the torque; N m if it is left out.
    """

    joint: str
    measured_nm: Numbers
    residual_nm: Numbers
    noise_nm: Numbers
    unit: str | None = None


class SpectrumCurves(Section):
    """Spectrum of the residual of a mean period, with the noise floor.

    Attributes:
        sentence: Description of the curves.
        frequency_hz: The harmonics [Hz].
        axes: Spectrum of each axis.
    """

    sentence: str
    frequency_hz: Numbers
    axes: tuple[SpectrumCurve, ...]

    @classmethod
    def of(
        cls, robot: RobotDescription, comparison: PeriodComparison, periods: int
    ) -> SpectrumCurves:
        """Return the spectra of a mean period.

        Args:
            periods: Number of averaged periods.
        """
        return cls(
            sentence="RMS per harmonic of the mean period: torque, residual of the model"
            " (standstill included), and noise estimated from the scatter between"
            f" periods ({periods} averaged). The anti-alias filter is divided out.",
            frequency_hz=round_values(comparison.frequency_hz[1:], 7),
            axes=SpectrumCurve.for_each(
                joint=robot.joint_names,
                measured_nm=map(round_values, comparison.measured_spectrum_nm[1:].T),
                residual_nm=map(round_values, comparison.residual_spectrum_nm[1:].T),
                noise_nm=map(round_values, comparison.noise_spectrum_nm[1:].T),
                unit=[joint.torque_unit for joint in robot.joints],
            ),
        )


class CurvesSection(Section):
    """The curves of a report.

    Attributes:
        torque: Torque over time; left out without data.
        spectrum: Spectrum of the residual; left out without data.
    """

    torque: TorqueCurves | None = None
    spectrum: SpectrumCurves | None = None

    @classmethod
    def of_period(
        cls, estimate: Estimate, comparison: PeriodComparison, periods: int
    ) -> CurvesSection:
        """Return the curves of a mean period to which a model was fitted.

        Args:
            periods: Number of averaged periods.
        """
        return cls(
            torque=TorqueCurves.of_period(estimate, comparison, periods),
            spectrum=SpectrumCurves.of(estimate.robot, comparison, periods),
        )


class AxisTraces(Section):
    """Recorded quantities of an axis.

    Attributes:
        joint: Name of the joint.
        unit: Unit of the joint's position.
        torque_unit: Unit of the joint's torque.
        position: Measured position, in `unit`.
        speed: Speed of the measured position, in `unit` per second.
        torque: Measured torque, in `torque_unit`.
        set_point: Commanded position, in `unit`; left out if the recording has no set-points.
        following_error: Set-point minus position, in `unit`; left out without set-points.
    """

    joint: str
    unit: str
    torque_unit: str
    position: Numbers
    speed: Numbers
    torque: Numbers
    set_point: Numbers | None = None
    following_error: Numbers | None = None


class Traces(Section):
    """Recorded quantities over time, thinned without loss of peaks.

    Attributes:
        rows_per_step: Number of recorded rows in a step.
        time_s: Times from the first point [s]. A step of several rows has two points, at the times
            of its first and of its middle row: the lowest and the highest value, in the order in
            which they occur.
        axes: Traces of each axis.
    """

    rows_per_step: int
    time_s: Numbers
    axes: tuple[AxisTraces, ...]

    @classmethod
    def of(cls, parts: Iterable[Recording], valid_rows: int, robot: RobotDescription) -> Traces:
        """Return the traces of a recording; rows without a valid answer are left out.

        Args:
            parts: Consecutive parts of the recording, of which one is in memory at a time.
            valid_rows: Number of valid rows of all parts, at least two. The first one is left out,
                because its speed is unknown.
            robot: Robot with the units of its joints.
        """
        count = -(-(valid_rows - 1) // TRACE_STEPS)
        time_s, steps = [], []
        for times, values in _steps(parts, count):
            time_s.append(times)
            steps.append(values)
        times, table = np.concatenate(time_s), np.concatenate(steps)
        has_set_points = table.shape[1] == len(_WITH_SET_POINTS)
        names = _WITH_SET_POINTS if has_set_points else _MEASURED
        axes = []
        for j, joint in enumerate(robot.joints):
            columns = {name: round_values(table[:, i, j]) for i, name in enumerate(names)}
            axes.append(
                AxisTraces(
                    joint=joint.name, unit=joint.unit, torque_unit=joint.torque_unit, **columns
                )
            )
        return cls(rows_per_step=count, time_s=round_values(times - times[0], 7), axes=tuple(axes))


_MEASURED: Final = ("position", "speed", "torque")
_WITH_SET_POINTS: Final = (*_MEASURED, "set_point", "following_error")


def _steps(parts: Iterable[Recording], count: int) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield times and extreme values, (points, quantities, joints), of steps of `count` rows."""
    left_s, left = np.empty(0), None
    before: Recording | None = None
    for piece in (piece for part in parts for piece in part.pieces()):
        valid = piece.part(piece.valid)
        if not len(valid):
            continue
        if before is not None:
            valid = concatenate_recordings([before, valid])
        before = valid.part(slice(-1, None))
        values = _quantities(valid)
        left_s = np.concatenate([left_s, valid.time_s[1:]])
        left = values if left is None else np.concatenate([left, values])
        whole = len(left) // count * count
        if whole:
            yield _extremes(left_s[:whole], left[:whole], count)
        left_s, left = left_s[whole:], left[whole:]
    if left is not None and len(left):
        yield _extremes(left_s, left, len(left))


def _quantities(valid: Recording) -> FloatArray:
    """Return the quantities of all rows but the first, shape (rows, quantities, joints).

    Args:
        valid: A recording of valid rows only.
    """
    speed = np.diff(valid.position, axis=0) / np.diff(valid.time_s)[:, np.newaxis]
    found = [valid.position[1:], speed, valid.torque_nm[1:]]
    if valid.target_position is not None:
        target = valid.target_position[1:]
        found += [target, target - valid.position[1:]]
    return np.stack(found, axis=1)


def _extremes(time_s: FloatArray, values: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Return times, and the lowest and highest value of each step in the order of their rows."""
    if count == 1:
        return time_s, values
    steps = values.reshape(-1, count, *values.shape[1:])
    rows = np.sort(np.stack([steps.argmin(axis=1), steps.argmax(axis=1)], axis=1), axis=1)
    both = np.take_along_axis(steps, rows, axis=1)
    times = time_s.reshape(-1, count)[:, [0, count // 2]]
    return times.ravel(), both.reshape(-1, *values.shape[1:])
