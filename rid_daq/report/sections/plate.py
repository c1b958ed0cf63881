"""`PlateSection`: what a force plate under the robot adds to an estimate."""

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
    """What the model leaves of one component of the base wrench, RMS in `unit`.

    Attributes:
        name, unit: The component.
        residual, noise: Left over, and what noise alone would leave.
        percent: The residual in percent of the component, at least of a share of the largest like
            it.
        grade, reason: "good", "doubtful" or "bad", and what decides it.
    """

    name: str
    unit: str
    residual: float
    noise: float
    percent: float | None = None
    grade: Grade | None = None
    reason: str


class ImprovedParameter(Section):
    """A parameter with its standard deviation by torques, by the plate, and by both, in `unit`."""

    words: str
    unit: str
    value: float
    std_internal: float | None
    std_external: float | None
    std_combined: float


class ImprovementSection(Section):
    """What the plate improved.

    Attributes:
        determinant_ratio: Of the covariances of the shared parameters.
        shared: Parameters that torques and plate both show.
        parameters: All of them.
    """

    determinant_ratio: float
    shared: Texts
    parameters: tuple[ImprovedParameter, ...]

    @classmethod
    def of(cls, improved: Improvement) -> ImprovementSection:
        """Return what the combined model says of the plate's gain."""
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
    """How an axis' torque constant compares with the plate.

    Attributes:
        joint: Its name.
        ratio, std: Measured torque over the torque that the plate expects, and its standard
            deviation: above 1 the drive measures too much.
        p_value: Probability of such a difference by noise.
        wrong: Whether the torque constant is wrong by it.
    """

    joint: str
    ratio: float
    std: float
    p_value: float
    wrong: bool


class TorqueConstants(Section):
    """Whether the torque constants agree with the plate.

    Attributes:
        p_value: Probability of such differences by noise, all axes together.
        axes: One an axis.
    """

    p_value: float
    axes: tuple[AxisTorqueScale, ...]

    @classmethod
    def of(cls, torques: TorqueConsistency) -> TorqueConstants:
        """Return how torque constants compare with the plate."""
        axes = tuple(AxisTorqueScale.from_attributes(axis, std=axis.sigma) for axis in torques.axes)
        return cls(p_value=torques.p_value, axes=axes)


class PlateSection(Section):
    """How a force plate fits an estimate, and what it improved.

    Attributes:
        sentences: All of it in words.
        components: One a component of the base wrench.
        delay_s, delay_std_s: How late the plate's signals were, one a run [s].
        left_out: Channels that are not used, run by run.
        drift_n_s: Drift that was removed, run by run, one a channel [N/s].
        improvement: Of the combined model.
        torque_constants: Of the combined model, if it explains the plate.
        mistake: What is probably wrong in its description; left out if nothing explains it better.
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
        """The components of the wrench that the model does not explain."""
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
        """Return how a force plate fits an estimate.

        Args:
            plate: Of the external or the combined model.
            weight: Parameters that only the standing weight shows, in words.
            improved, torques: What the combined model says of the plate's gain and of the torque
                constants.
            mistake: What is probably wrong in the plate's description.
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
            sentences.append(f"The model does not explain the whole base wrench. {names}.")
        if doubts and mistake is None:
            sentences.append(
                "Suspect the plate first: its sizes, position_m, rotation_rad and sensitivities in"
                " the cell file. Torque constants are not compared with it."
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
    words = f"The force plate's signals were {delays} ms late, which is made up for"
    words += f"; drift of up to {1e3 * abs(plate.drift_n_s).max():.3g} mN/s a channel is removed"
    left_out = sorted({name for names in plate.left_out for name in names})
    if left_out:
        words += f"; {', '.join(left_out)} not used, for overload, loss or drift"
    if weight:
        words += (
            f". {', '.join(weight)} is the standing weight, which a plate cannot tell from its"
            " offset"
        )
    return words + "."
