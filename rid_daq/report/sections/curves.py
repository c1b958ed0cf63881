"""`CurvesSection`: torque over time, and by frequency against the noise floor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Strict

from config.robot.robot import RobotDescription
from rid_daq.report.sections.section import Numbers, Section, curve_rows, finite, rounded, units

if TYPE_CHECKING:
    from identification.estimation.estimate import Estimate
    from identification.validation.period_comparison import PeriodComparison
    from identification.validation.torque_prediction import Validation


class TorqueCurve(Section):
    """Measured and predicted torque of an axis, one value a time, in `unit`.

    Attributes:
        joint, unit, caption: Its name, the unit, and how large the error is.
        measured, predicted: The torques.
        counted: 1 where the error counts, 0 where the axis stands still or its friction is not
            known.
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
        sentence: What is drawn.
        time_s: [s].
        axes: One an axis.
    """

    sentence: str
    time_s: Numbers
    axes: tuple[TorqueCurve, ...]

    @classmethod
    def of(cls, validation: Validation, robot: RobotDescription) -> TorqueCurves:
        """Return measured and predicted torque over time, and what counts."""
        rows = curve_rows(len(validation.time_s))
        axes = []
        unknown = "" if validation.known.all() else ", or friction that is not known yet"
        for i, joint in enumerate(robot.joints):
            error, share = finite(validation.rms_nm[i]), finite(validation.relative_percent[i])
            unit = units(joint)[1]
            caption = "stands still"
            if error is not None and share is not None:
                caption = f"RMS error (counted) {error:.3g} {unit}, {share:.3g} %"
            axes.append(
                TorqueCurve(
                    joint=joint.name,
                    unit=unit,
                    caption=caption,
                    measured=rounded(validation.measured_nm[rows, i]),
                    predicted=rounded(validation.predicted_nm[rows, i]),
                    counted=tuple(map(int, validation.counted[rows, i])),
                )
            )
        return cls(
            sentence=f"Grey: samples that do not count: standstill{unknown}. Every RMS is of the"
            " other samples; percent are of their RMS torque.",
            time_s=rounded(validation.time_s[rows] - validation.time_s[0], 7),
            axes=tuple(axes),
        )

    @classmethod
    def of_period(
        cls, estimate: Estimate, comparison: PeriodComparison, periods: int
    ) -> TorqueCurves:
        """Return the torques of a mean of so many periods, with what was fitted to them."""
        rows = curve_rows(len(comparison.time_s))
        axes = []
        for i, joint in enumerate(estimate.robot.joints):
            unit, counted = units(joint)[1], comparison.counted[:, i]
            left = (comparison.measured_nm - comparison.fitted_nm)[counted, i]
            caption = "stands still"
            if counted.any():
                caption = f"RMS residual (counted) {np.sqrt(np.mean(left**2)):.3g} {unit}"
            axes.append(
                TorqueCurve(
                    joint=joint.name,
                    unit=unit,
                    caption=caption,
                    measured=rounded(comparison.measured_nm[rows, i]),
                    predicted=rounded(comparison.fitted_nm[rows, i]),
                    counted=tuple(map(int, comparison.counted[rows, i])),
                )
            )
        of_run = "" if len(estimate.run_ids) < 2 else " of the first run"
        return cls(
            sentence=f"The mean of {periods} periods{of_run} up to"
            f" {comparison.frequency_hz[-1]:.3g} Hz; the model was fitted to it. Grey: samples that"
            f" do not count, slower than {estimate.standstill_rad_s:g} rad/s or before presliding"
            " friction is known; there the fit leaves the torque free. Every RMS is of the other"
            " samples. The residual in the table of the estimate is over the whole period and all"
            " runs.",
            time_s=rounded(comparison.time_s[rows], 7),
            axes=tuple(axes),
        )


class SpectrumCurve(Section):
    """RMS torque of an axis at each harmonic, in `unit`: measured, residual, and of noise alone.

    Without `unit` it is N m.
    """

    joint: str
    measured_nm: Numbers
    residual_nm: Numbers
    noise_nm: Numbers
    unit: str | None = None


class SpectrumCurves(Section):
    """What a model leaves of a mean period, against the noise floor.

    Attributes:
        sentence: What is drawn.
        frequency_hz: The harmonics [Hz].
        axes: One an axis.
    """

    sentence: str
    frequency_hz: Numbers
    axes: tuple[SpectrumCurve, ...]

    @classmethod
    def of(
        cls, robot: RobotDescription, comparison: PeriodComparison, periods: int
    ) -> SpectrumCurves:
        """Return a mean period's torques by frequency."""
        return cls(
            sentence="Per harmonic of the mean period: torque, what the model leaves of it"
            " (standstill included), and what the noise between periods leaves there"
            f" ({periods} averaged). Anti-alias filter divided out.",
            frequency_hz=rounded(comparison.frequency_hz[1:], 7),
            axes=SpectrumCurve.for_each(
                joint=robot.joint_names,
                measured_nm=map(rounded, comparison.measured_spectrum_nm[1:].T),
                residual_nm=map(rounded, comparison.residual_spectrum_nm[1:].T),
                noise_nm=map(rounded, comparison.noise_spectrum_nm[1:].T),
                unit=[units(joint)[1] for joint in robot.joints],
            ),
        )


class CurvesSection(Section):
    """The curves of a report; each is left out where there is none."""

    torque: TorqueCurves | None = None
    spectrum: SpectrumCurves | None = None

    @classmethod
    def of_period(
        cls, estimate: Estimate, comparison: PeriodComparison, periods: int
    ) -> CurvesSection:
        """Return the curves of a mean of so many periods, to which a model was fitted."""
        return cls(
            torque=TorqueCurves.of_period(estimate, comparison, periods),
            spectrum=SpectrumCurves.of(estimate.robot, comparison, periods),
        )
