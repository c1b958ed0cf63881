"""The base wrench: `ReactionSection` compares it with a plate, `BaseLoadSection` with limits."""

from __future__ import annotations

from typing import TYPE_CHECKING

from acquisition.recording.plate_geometry import WRENCH_NAMES, WRENCH_UNITS
from rid_daq.report.sections.section import Numbers, Section, round_values, thinning_slice
from rid_daq.report.sections.verdict import VerdictCheck

if TYPE_CHECKING:
    from identification.calibration.base_reaction import BaseLoad
    from identification.validation.base_wrench_validation import BaseWrenchValidation


class WrenchError(Section):
    """Error of one predicted component of the base wrench, in `unit`.

    Attributes:
        name: Name of the component.
        unit: Unit of the component.
        rms_error: RMS of measured minus predicted component.
        relative_error_percent: RMS error relative to the measured component [%].
        noise: RMS noise of the measurement; None if it is not known.
        measured: Measured curve, thinned for drawing.
        predicted: Predicted curve, thinned for drawing.
    """

    name: str
    unit: str
    rms_error: float
    relative_error_percent: float
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
                noise=[None] * 6 if validation.noise is None else validation.noise,
                measured=map(round_values, validation.measured[rows].T),
                predicted=map(round_values, validation.predicted[rows].T),
            ),
            time_s=round_values(validation.time_s[rows] - validation.time_s[0], 7),
        )


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
