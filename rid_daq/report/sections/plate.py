"""`PlateSection`: the improvement of an estimate by a force plate under the robot."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from pydantic import Strict

from acquisition.recording.plate_geometry import WRENCH_NAMES, WRENCH_UNITS
from identification.calibration.plate_mistake import PlateMistake
from identification.regression.fit_grade import Grade
from rid_daq.blocks.formats import format_measured
from rid_daq.report.sections.section import Numbers, Section, Texts

if TYPE_CHECKING:
    from collections.abc import Sequence

    from identification.accuracy.plate_benefit import Improvement
    from identification.calibration.torque_scale import TorqueConsistency
    from identification.equations.plate_fit import PlateFit


class WrenchResidual(Section):
    """Residual of one component of the base wrench.

    Attributes:
        name: Name of the component.
        unit: Unit of the component.
        residual: RMS of measured minus predicted component, in `unit`.
        noise: RMS residual that noise alone would cause, in `unit`.
        percent: Residual relative to the component [%]. A small component counts as a fixed
            fraction of the largest component of its unit.
        grade: "good", "doubtful" or "bad".
        reason: Reason for the grade.
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
        std_internal: Standard deviation of an estimate from the torques alone, in `unit`.
        std_external: Standard deviation of an estimate from the plate alone, in `unit`.
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
        """The components of the base wrench that the model does not explain."""
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
                "First check the plate's description in the cell file: its sizes, position_m,"
                " rotation_rad and sensitivities. The torque constants were not compared with"
                " the plate."
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
        words += f"; {', '.join(left_out)} not used because of overload, loss or drift"
    if weight:
        words += (
            f". {', '.join(weight)}: identifiable only from the robot's weight, which a plate"
            " cannot distinguish from its own offset"
        )
    return words + "."
