"""`ValidationSection`: predicted and measured torque; `TruthCase`: estimated and true values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from identification.regression.fit_grade import Grade
from rid_daq.blocks.formats import number
from rid_daq.report.sections.section import Numbers, Section, Texts, finite_or_none

if TYPE_CHECKING:
    from identification.validation.torque_prediction import Validation
    from rid_daq.report.sections.estimate import EstimateSection


class AxisError(Section):
    """Torque error of an axis, in `unit`. Only samples count at which the axis moves.

    Attributes:
        joint: Name of the joint.
        unit: Unit of the torque.
        rms_torque: RMS of the measured torque; null if no sample counts.
        rms_error: RMS of the torque error; null if no sample counts.
        relative_error_percent: RMS error relative to the RMS torque, on the samples that count [%];
            null if no sample counts.
        all_samples_percent: RMS error relative to the RMS torque, on all samples except
            `unknown_samples` [%]; null if there are none.
        noise: RMS error that the measured noise alone causes after the low-pass filter; null if a
            recording has no periods, or too few to estimate it.
        floor: RMS error of the torques predicted with the true parameters; null if they are not
            known or no sample counts.
        error_over_floor: RMS error divided by `floor`; null if `floor` is null or 0.
        limit_percent: Limit of the relative error [%]; null if no limit was set.
        passed: True if the relative error is within its limit; null if no limit was set or no
            sample counts.
        samples: Number of samples that count.
        unknown_samples: Number of samples, moving or not, whose friction depends on the motion
            before the recording or in a gap of the recording. They do not count. Left out if there
            are none.
        over_noise: RMS error divided by the error that noise alone causes; left out if the noise is
            not known, or if no limit was set.
        grade: "good", "doubtful" or "bad"; left out if no sample counts, or if no limit was set.
        reason: Reason for the grade, or for its absence; left out if no limit was set.
    """

    joint: str
    unit: str
    rms_torque: float | None
    rms_error: float | None
    relative_error_percent: float | None
    all_samples_percent: float | None
    noise: float | None
    floor: float | None
    error_over_floor: float | None
    limit_percent: float | None
    passed: bool | None
    samples: int
    unknown_samples: int | None = None
    over_noise: float | None = None
    grade: Grade | None = None
    reason: str | None = None


class ValidationSection(Section):
    """Torque errors of every axis, with their limits.

    Attributes:
        sentence: Description of the comparison.
        cutoff_hz: Cut-off frequency of the low-pass filter for all signals [Hz].
        standstill_rad_s: Lowest speed of a sample that counts [rad/s].
        has_floor: True if the true parameters are known.
        has_limits: True if the errors have limits.
        axes: Errors of each axis.
        diagnosis: Probable causes of the errors; left out if no diagnosis was made.
    """

    sentence: str
    cutoff_hz: float
    standstill_rad_s: float
    has_floor: bool
    has_limits: bool
    axes: tuple[AxisError, ...]
    diagnosis: Texts | None = None

    @classmethod
    def of(
        cls,
        validation: Validation,
        robot: RobotDescription,
        sentence: str,
        floor_nm: FloatArray | None = None,
        diagnosis: Sequence[str] | None = None,
    ) -> ValidationSection:
        """Return the torque errors of every axis.

        Args:
            validation: The comparison.
            robot: Robot with the units.
            sentence: Sentence that names the predicted run.
            floor_nm: Shape (n,). RMS error of the torques predicted with the true parameters [N m
                or N]; None if the robot is not simulated.
            diagnosis: Probable causes of the errors.
        """
        shares = ", ".join(f"{100.0 * share:.0f}" for share in validation.counted_fraction)
        return cls(
            sentence=f"{sentence} Signals are low-pass filtered at {validation.cutoff_hz:g} Hz"
            f" without phase shift. Only samples at {validation.standstill_rad_s:g}"
            f" rad/s or faster count for the errors ({shares} % of each axis): at lower"
            f" speeds, friction is stiction.{_remarks(validation)}",
            cutoff_hz=validation.cutoff_hz,
            standstill_rad_s=validation.standstill_rad_s,
            has_floor=floor_nm is not None,
            has_limits=validation.limits_percent is not None,
            axes=tuple(
                _axis(
                    validation, robot, i, None if floor_nm is None else finite_or_none(floor_nm[i])
                )
                for i in range(len(robot.joints))
            ),
            diagnosis=None if diagnosis is None else tuple(diagnosis),
        )

    @property
    def has_noise(self) -> bool:
        """True if the noise of an axis is known."""
        return any(axis.noise is not None for axis in self.axes)


def _axis(
    validation: Validation, robot: RobotDescription, i: int, floor: float | None
) -> AxisError:
    joint = robot.joints[i]
    counted = validation.counted[:, i]
    measured = validation.measured_nm[counted, i]
    unknown = int(np.count_nonzero(~validation.known[:, i]))
    error = finite_or_none(validation.rms_nm[i])
    limits, fit = validation.limits_percent, validation.fit[i]
    over = fit.over_noise if limits else None
    return AxisError(
        joint=joint.name,
        unit=joint.torque_unit,
        rms_torque=float(np.sqrt(np.mean(measured**2))) if len(measured) else None,
        rms_error=error,
        relative_error_percent=finite_or_none(validation.relative_percent[i]),
        all_samples_percent=finite_or_none(validation.all_samples_percent[i]),
        noise=None if validation.noise_nm is None else float(validation.noise_nm[i]),
        floor=floor,
        error_over_floor=None if error is None or not floor else error / floor,
        limit_percent=None if limits is None else limits[i],
        passed=validation.verdicts[i],
        samples=int(np.count_nonzero(counted)),
        unknown_samples=unknown or None,
        over_noise=None if over is None else finite_or_none(over),
        grade=fit.grade if limits else None,
        reason=fit.reason if limits else None,
    )


class RunErrors(Section):
    """Torque errors of one of several runs that are judged together.

    Attributes:
        run: Label of the run.
        axes: Errors of each axis, without limits.
    """

    run: str
    axes: tuple[AxisError, ...]

    @classmethod
    def of(cls, run: str, validation: Validation, robot: RobotDescription) -> RunErrors:
        """Return the errors of a run."""
        alone = replace(validation, limits_percent=None)
        return cls(
            run=run, axes=tuple(_axis(alone, robot, i, None) for i in range(len(robot.joints)))
        )


class TruthCase(Section):
    """Comparison of the estimated parameters of one simulated robot with the true values.

    Attributes:
        title: Name of the simulated robot.
        sentence: Result of the comparison.
        inside: Number of true values inside the two-sigma intervals.
        of: Number of compared parameters.
        deviation_sigmas: Deviation of each estimate from the true value [standard deviations].
    """

    title: str
    sentence: str
    inside: int
    of: int
    deviation_sigmas: Numbers

    @classmethod
    def from_estimate(cls, title: str, estimate: EstimateSection) -> TruthCase:
        """Return the comparison of an estimate with its true values."""
        parameters = [each for each in estimate.parameters if each.deviation_sigmas is not None]
        inside = sum(bool(each.inside_two_sigma) for each in parameters)
        return cls(
            title=title,
            sentence=f"{title}: {inside} of {len(parameters)} true values are inside their"
            f" two-sigma intervals ({100.0 * inside / len(parameters):.0f} %).",
            inside=inside,
            of=len(parameters),
            deviation_sigmas=tuple(each.deviation_sigmas or 0.0 for each in parameters),
        )


def _remarks(validation: Validation) -> str:
    """Return sentences on torque channel, presliding and samples that were left out."""
    said = ""
    if validation.channel is not None and validation.channel.changes:
        said += (
            f" The delay or filter of the model's recording ({validation.channel.kind}) was also"
            " applied to the predicted torque."
        )
    if validation.remembering:
        errors = ", ".join(number(error, 3) for error in validation.all_samples_percent)
        said += (
            f" The friction of {', '.join(validation.remembering)} includes presliding: if all"
            f" samples count, standstill included, the errors of the axes are {errors} %."
        )
    unknown = np.count_nonzero(~validation.known, axis=0)
    if unknown.any():
        step_s = float(np.median(np.diff(validation.time_s)))
        left_out = ", ".join(
            f"{count} of {name} ({number(count * step_s, 2)} s)"
            for name, count in zip(validation.joint_names, unknown.tolist(), strict=True)
            if count
        )
        said += (
            " Presliding friction depends on the motion before the recording or in a gap of the"
            " recording, so it is not known at first. Samples that were left out for this"
            f" reason: {left_out}."
        )
    return said
