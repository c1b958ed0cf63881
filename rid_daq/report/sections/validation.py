"""`ValidationSection`, `TruthCase`: predicted against measured torque, estimated against true."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from identification.regression.fit_grade import Grade
from rid_daq.blocks.formats import number
from rid_daq.report.sections.section import Numbers, Section, Texts, finite, units

if TYPE_CHECKING:
    from identification.validation.torque_prediction import Validation
    from rid_daq.report.sections.estimate import EstimateSection


class AxisError(Section):
    """The torque error of an axis, in `unit`, on samples at which it moves.

    Attributes:
        joint, unit: Its name, and the unit of its torque.
        rms_torque, rms_error: Root mean squares; None where it stands still.
        relative_error_percent, all_samples_percent: Error over torque [%], on moving samples and on
            all.
        noise: Of one measured sample, where periods show it.
        floor, error_over_floor: Of a simulated robot: the error of the true parameters, and the
            error over it.
        limit_percent: What the relative error is held to [%].
        passed: Whether it holds.
        samples: That count.
        unknown_samples: That do not count, moving or not, because they depend on where the joint
            came from before the recording or in a gap of it; left out where there is none.
        over_noise: The error over what noise alone leaves, where periods show it.
        grade, reason: "good", "doubtful" or "bad", and what decides it. Left out of an external
            model.
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
    """The torque errors of every axis, and what they are held to.

    Attributes:
        sentence: What is compared.
        cutoff_hz: Signals are compared up to here [Hz].
        standstill_rad_s: Lowest speed that counts [rad/s].
        has_floor, has_limits: Whether the truth is known, and whether limits are given.
        axes: One an axis.
        diagnosis: What the errors look like; left out where nobody looked.
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
            robot: The robot, for units.
            sentence: Which run was predicted.
            floor_nm: Shape (n,). RMS error of the true parameters, where the robot is simulated.
            diagnosis: What the errors look like.
        """
        shares = ", ".join(f"{100.0 * share:.0f}" for share in validation.counted_fraction)
        return cls(
            sentence=f"{sentence} Signals below {validation.cutoff_hz:g} Hz (no phase shift);"
            f" errors count samples at {validation.standstill_rad_s:g} rad/s or faster ({shares} %"
            f" of each axis): below, friction is stiction.{_besides(validation)}",
            cutoff_hz=validation.cutoff_hz,
            standstill_rad_s=validation.standstill_rad_s,
            has_floor=floor_nm is not None,
            has_limits=validation.limits_percent is not None,
            axes=tuple(
                _axis(validation, robot, i, None if floor_nm is None else finite(floor_nm[i]))
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
    error = finite(validation.rms_nm[i])
    limits, fit = validation.limits_percent, validation.fit[i]
    return AxisError(
        joint=joint.name,
        unit=units(joint)[1],
        rms_torque=float(np.sqrt(np.mean(measured**2))) if len(measured) else None,
        rms_error=error,
        relative_error_percent=finite(validation.relative_percent[i]),
        all_samples_percent=finite(validation.all_samples_percent[i]),
        noise=None if validation.noise_nm is None else float(validation.noise_nm[i]),
        floor=floor,
        error_over_floor=None if error is None or not floor else error / floor,
        limit_percent=None if limits is None else limits[i],
        passed=validation.verdicts[i],
        samples=int(np.count_nonzero(counted)),
        unknown_samples=unknown or None,
        over_noise=fit.over_noise if limits else None,
        grade=fit.grade if limits else None,
        reason=fit.reason if limits else None,
    )


class TruthCase(Section):
    """How the parameters of one simulated robot compare with the truth.

    Attributes:
        title, sentence: Which robot, and what was found.
        inside, of: Parameters inside their two-sigma intervals, of so many.
        deviation_sigmas: How far each is off, in standard deviations.
    """

    title: str
    sentence: str
    inside: int
    of: int
    deviation_sigmas: Numbers

    @classmethod
    def compared(cls, title: str, estimate: EstimateSection) -> TruthCase:
        """Return how an estimate whose truth is known compares with it."""
        parameters = [each for each in estimate.parameters if each.deviation_sigmas is not None]
        inside = sum(bool(each.inside_two_sigma) for each in parameters)
        return cls(
            title=title,
            sentence=f"{title}: {inside} of {len(parameters)} true values lie inside the two-sigma"
            f" interval ({100.0 * inside / len(parameters):.0f} %).",
            inside=inside,
            of=len(parameters),
            deviation_sigmas=tuple(each.deviation_sigmas or 0.0 for each in parameters),
        )


def _besides(validation: Validation) -> str:
    """Say what else the errors rest on, after the sentence of the samples."""
    said = ""
    if validation.channel is not None and validation.channel.changes:
        said += (
            f" The predicted torque passes the torque channel of the model's recording"
            f" ({validation.channel.kind})."
        )
    if validation.remembering:
        errors = ", ".join(number(error, 3) for error in validation.all_samples_percent)
        said += (
            f" The friction of {', '.join(validation.remembering)} has memory: with every sample"
            f" counted, standstill too, the errors of the axes are {errors} %."
        )
    unknown = np.count_nonzero(~validation.known, axis=0)
    if unknown.any():
        step_s = float(np.median(np.diff(validation.time_s)))
        told = ", ".join(
            f"{count} of {name} ({number(count * step_s, 2)} s)"
            for name, count in zip(validation.joint_names, unknown.tolist(), strict=True)
            if count
        )
        said += (
            " Where they came from before the recording, or in a gap of it, is not known and"
            f" decides their friction at first: samples that are left out, {told}."
        )
    return said
