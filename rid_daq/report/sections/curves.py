"""`CurvesSection`: torque over time, and residuals over frequency with the noise floor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Strict

from config.robot.robot import RobotDescription
from rid_daq.report.sections.section import (
    Numbers,
    Section,
    finite_or_none,
    joint_units,
    round_values,
    thinning_slice,
)

if TYPE_CHECKING:
    from identification.estimation.estimate import Estimate
    from identification.validation.period_comparison import PeriodComparison
    from identification.validation.torque_prediction import Validation


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
            unit = joint_units(joint)[1]
            caption = "standstill"
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
            unit, counted = joint_units(joint)[1], comparison.counted[:, i]
            left = (comparison.measured_nm - comparison.fitted_nm)[counted, i]
            caption = "standstill"
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
                unit=[joint_units(joint)[1] for joint in robot.joints],
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
