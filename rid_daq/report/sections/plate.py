"""The force plate: `PlateSection`, the improvement of an estimate by a plate under the robot.

`ReactionSection` compares a predicted base wrench with a plate, `BaseLoadSection` with limits.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from pydantic import Strict

from acquisition.recording.plate_geometry import WRENCH_NAMES, WRENCH_UNITS
from identification.calibration.plate_mistake import PlateMistake
from identification.regression.fit_grade import Grade
from rid_daq.blocks.formats import format_measured
from rid_daq.report.sections.section import (
    Numbers,
    Section,
    Texts,
    round_values,
    thinning_slice,
)
from rid_daq.report.sections.verdict import VerdictCheck

if TYPE_CHECKING:
    from collections.abc import Sequence

    from identification.accuracy.plate_benefit import Improvement
    from identification.calibration.base_reaction import BaseLoad
    from identification.calibration.torque_scale import TorqueConsistency
    from identification.equations.plate_fit import PlateFit
    from identification.validation.base_wrench_validation import BaseWrenchValidation


class WrenchResidual(Section):
    """Residual of one component of the base wrench.

    Attributes:
        name: Name of the component.
        unit: Unit of the component.
        residual: RMS of measured minus predicted component, in `unit`.
        noise: RMS residual that noise alone would cause, in `unit`.
        percent: Residual relative to the component [%]. A small component counts as a fixed
            fraction of the largest component of its unit. Left out if all components of its unit
            are 0.
        grade: "good", "doubtful" or "bad"; left out if `percent` is left out.
        reason: Reason for the grade, or for its absence.
    """

    name: str
    unit: str
    residual: float
    noise: float
    percent: float | None = None
    grade: Grade | None = None
    reason: str


class ImprovedParameter(Section):
    """One parameter, with its standard deviations if estimated from torques, plate, or both.

    Attributes:
        words: The parameter as a combination of standard parameters.
        unit: Unit of the parameter.
        value: Estimate from torques and plate together, in `unit`.
        std_internal: Standard deviation of an estimate from the torques alone, in `unit`; null if
            the torques alone do not identify the parameter.
        std_external: Standard deviation of an estimate from the plate alone, in `unit`; null if the
            plate alone does not identify the parameter.
        std_combined: Standard deviation of an estimate from torques and plate together, in `unit`.
    """

    words: str
    unit: str
    value: float
    std_internal: float | None
    std_external: float | None
    std_combined: float


class ImprovementSection(Section):
    """Improvement of the parameters by the plate.

    Attributes:
        determinant_ratio: Determinant of the covariance of the shared parameters, estimated from
            torques alone, divided by that from torques and plate together.
        shared: Parameters that are identifiable both from torques and from the plate.
        parameters: All parameters.
    """

    determinant_ratio: float
    shared: Texts
    parameters: tuple[ImprovedParameter, ...]

    @classmethod
    def of(cls, improved: Improvement) -> ImprovementSection:
        """Return the improvement that the combined model computed."""
        return cls.from_attributes(
            improved,
            parameters=tuple(
                ImprovedParameter.from_attributes(
                    each,
                    words=each.expression,
                    std_internal=each.sigma_internal,
                    std_external=each.sigma_external,
                    std_combined=each.sigma_combined,
                )
                for each in improved.parameters
            ),
        )


class AxisTorqueScale(Section):
    """Torque scale of an axis: its torque constant relative to the force plate.

    Attributes:
        joint: Name of the joint.
        ratio: Measured torque divided by the torque that the plate implies; above 1 if the drive
            reports too much torque.
        std: Standard deviation of the ratio.
        p_value: Probability that noise alone causes a difference at least as large.
        wrong: True if the difference shows that the torque constant is wrong.
    """

    joint: str
    ratio: float
    std: float
    p_value: float
    wrong: bool


class TorqueConstants(Section):
    """Comparison of all torque constants with the force plate.

    Attributes:
        p_value: Probability that noise alone causes differences at least as large, for all axes
            together.
        axes: Torque scale of each axis.
    """

    p_value: float
    axes: tuple[AxisTorqueScale, ...]

    @classmethod
    def of(cls, torques: TorqueConsistency) -> TorqueConstants:
        """Return the comparison of the torque constants with the plate."""
        axes = tuple(AxisTorqueScale.from_attributes(axis, std=axis.sigma) for axis in torques.axes)
        return cls(p_value=torques.p_value, axes=axes)


class PlateSection(Section):
    """Fit of a force plate's signals by an estimate, and the improvement by the plate.

    Attributes:
        sentences: Summary in words.
        components: Residual of each component of the base wrench.
        delay_s: Delay of the plate's signals, one value per run [s].
        delay_std_s: Standard deviation of the delay, one value per run [s].
        left_out: Channels that were left out, run by run.
        drift_n_s: Drift that was removed, run by run, one value per channel [N/s].
        improvement: Improvement by the plate; null unless the model is a combined one.
        torque_constants: Comparison of the torque constants with the plate. Null unless a combined
            model explains the plate's signals.
        mistake: Probable mistake in the plate's description; left out if no mistake explains the
            signals better.
    """

    sentences: Texts
    components: tuple[WrenchResidual, ...]
    delay_s: Numbers
    delay_std_s: Numbers
    left_out: Annotated[tuple[Texts, ...], Strict(False)]
    drift_n_s: Annotated[tuple[Numbers, ...], Strict(False)]
    improvement: ImprovementSection | None
    torque_constants: TorqueConstants | None
    mistake: PlateMistake | None = None

    @property
    def bad_components(self) -> tuple[str, ...]:
        """Names of the components of the base wrench whose fit is bad, not only doubtful."""
        return tuple(each.name for each in self.components if each.grade is Grade.BAD)

    @classmethod
    def of(
        cls,
        plate: PlateFit,
        weight: Sequence[str],
        improved: Improvement | None = None,
        torques: TorqueConsistency | None = None,
        mistake: PlateMistake | None = None,
    ) -> PlateSection:
        """Return the section of a force plate.

        Args:
            plate: Fit of the external or the combined model.
            weight: Parameters that are identifiable only from the robot's weight at standstill, in
                words.
            improved: Improvement by the plate, computed by a combined model.
            torques: Comparison of the torque constants with the plate, by a combined model.
            mistake: Probable mistake in the plate's description.
        """
        sentences = [_fit_sentence(plate, weight)]
        sentences += [] if improved is None else [improved.sentence]
        grades = plate.grades
        doubts = [each for each in grades if each.grade is not Grade.GOOD]
        if doubts or mistake is not None:
            torques = None
        sentences += [] if torques is None else [torques.sentence]
        if doubts:
            names = "; ".join(f"{each.joint}: {each.reason}" for each in doubts)
            sentences.append(f"The model does not explain the base wrench completely. {names}.")
        if doubts and mistake is None:
            sentences.append(
                "First check the plate's description in the cell file or import map: its sizes,"
                " position_m, rotation_rad and sensitivities. The torque constants were not"
                " compared with the plate."
            )
        sentences += [] if mistake is None else [mistake.sentence]
        return cls.from_attributes(
            plate,
            sentences=sentences,
            components=WrenchResidual.for_each(
                name=WRENCH_NAMES,
                unit=WRENCH_UNITS,
                residual=plate.residual,
                noise=plate.noise,
                percent=[each.percent for each in grades],
                grade=[each.grade for each in grades],
                reason=[each.reason for each in grades],
            ),
            delay_std_s=plate.delay_sigma_s,
            improvement=None if improved is None else ImprovementSection.of(improved),
            torque_constants=None if torques is None else TorqueConstants.of(torques),
            mistake=mistake,
        )


def _fit_sentence(plate: PlateFit, weight: Sequence[str]) -> str:
    delays = ", ".join(
        " ± ".join(format_measured(1e3 * float(delay), 2e3 * float(sigma)))
        for delay, sigma in zip(plate.delay_s, plate.delay_sigma_s, strict=True)
    )
    words = f"The force plate's signals were {delays} ms late; this delay is corrected"
    words += f"; drift of up to {1e3 * abs(plate.drift_n_s).max():.3g} mN/s per channel is removed"
    left_out = sorted({name for names in plate.left_out for name in names})
    if left_out:
        words += (
            f"; {', '.join(left_out)} not used because of overload, loss, drift or a constant value"
        )
    if weight:
        words += (
            f". {', '.join(weight)}: identifiable only from the robot's weight, which a plate"
            " cannot distinguish from its own offset"
        )
    return words + "."


class WrenchError(Section):
    """Error of one predicted component of the base wrench, in `unit`.

    Attributes:
        name: Name of the component.
        unit: Unit of the component.
        rms_error: RMS of measured minus predicted component.
        relative_error_percent: RMS error relative to the measured component [%].
        limit_percent: Largest relative error for a passed verdict [%]; left out in old reports.
        noise: RMS noise of the measurement; null if it is not known.
        measured: Measured curve, thinned for drawing.
        predicted: Predicted curve, thinned for drawing.
    """

    name: str
    unit: str
    rms_error: float
    relative_error_percent: float
    limit_percent: float | None = None
    noise: float | None
    measured: Numbers
    predicted: Numbers


class ReactionSection(Section):
    """Errors of a predicted base wrench.

    Attributes:
        sentence: Description of the comparison.
        delay_s: Delay of the force plate's signals [s].
        components: Error of each component.
        time_s: Times of the curves [s].
    """

    sentence: str
    delay_s: float
    components: tuple[WrenchError, ...]
    time_s: Numbers

    @classmethod
    def of(cls, validation: BaseWrenchValidation) -> ReactionSection:
        """Return the section for a comparison of predicted and measured base wrench."""
        rows = thinning_slice(len(validation.time_s))
        return cls.from_attributes(
            validation,
            components=WrenchError.for_each(
                name=WRENCH_NAMES,
                unit=WRENCH_UNITS,
                rms_error=validation.rms,
                relative_error_percent=validation.relative_percent,
                limit_percent=validation.limit_percent,
                noise=[None] * 6 if validation.noise is None else validation.noise,
                measured=map(round_values, validation.measured[rows].T),
                predicted=map(round_values, validation.predicted[rows].T),
            ),
            time_s=round_values(validation.time_s[rows] - validation.time_s[0], 7),
        )

    @property
    def checks(self) -> list[VerdictCheck]:
        """Comparison of each component's relative error with its limit."""
        return [
            VerdictCheck.of(
                f"relative error of the base wrench, {each.name}",
                each.relative_error_percent,
                "≤",
                each.limit_percent,
                "%",
            )
            for each in self.components
            if each.limit_percent is not None
        ]


class LoadComponent(Section):
    """Largest value of one component of the base wrench during a motion, in `unit`.

    Attributes:
        name: Name of the component.
        unit: Unit of the component.
        peak: Largest absolute value.
        std: Standard deviation of `peak`.
        at_s: Time of the largest value [s].
        limit: The allowed value.
        held: True if `peak` plus two standard deviations is within the limit.
    """

    name: str
    unit: str
    peak: float
    std: float
    at_s: float
    limit: float
    held: bool


class BaseLoadSection(Section):
    """Base wrench of a motion: the load on the floor, compared with its limits.

    Attributes:
        sentence: Summary in words.
        weight_known: True if the wrench contains the robot's weight.
        components: Largest value of each component.
    """

    sentence: str
    weight_known: bool
    components: tuple[LoadComponent, ...]

    @classmethod
    def of(cls, load: BaseLoad, more: str = "") -> BaseLoadSection:
        """Return the largest base wrench of a motion with its limits.

        Args:
            more: Additional sentence.
        """
        return cls(
            sentence=load.sentence + more,
            weight_known=load.weight_known,
            components=LoadComponent.for_each(
                name=WRENCH_NAMES,
                unit=WRENCH_UNITS,
                peak=load.peak,
                std=load.sigma,
                at_s=load.at_s,
                limit=load.limit,
                held=load.held,
            ),
        )

    @property
    def checks(self) -> list[VerdictCheck]:
        """Comparison of each component plus two standard deviations with its limit."""
        return [
            VerdictCheck.of(
                f"base wrench with 2σ, {each.name}",
                each.peak + 2.0 * each.std,
                "≤",
                each.limit,
                each.unit,
            )
            for each in self.components
        ]
