"""The reaction on the base: `ReactionSection` predicts it, `BaseLoadSection` holds it to limits."""

from __future__ import annotations

from typing import TYPE_CHECKING

from acquisition.recording.plate_geometry import WRENCH_NAMES, WRENCH_UNITS
from rid_daq.report.sections.section import Numbers, Section, curve_rows, rounded
from rid_daq.report.sections.verdict import VerdictCheck

if TYPE_CHECKING:
    from identification.calibration.base_reaction import BaseLoad
    from identification.validation.base_wrench_validation import BaseWrenchValidation


class WrenchError(Section):
    """The error of one component, in `unit`.

    Attributes:
        name, unit: The component.
        rms_error: Root mean square.
        relative_error_percent: Of the measured one [%].
        noise: Of the measurement, where it is known.
        measured, predicted: The curves, thinned for drawing.
    """

    name: str
    unit: str
    rms_error: float
    relative_error_percent: float
    noise: float | None
    measured: Numbers
    predicted: Numbers


class ReactionSection(Section):
    """The errors of a predicted base wrench.

    Attributes:
        sentence: What is compared.
        delay_s: How late the plate's signals were [s].
        components: One a component.
        time_s: Of the curves [s].
    """

    sentence: str
    delay_s: float
    components: tuple[WrenchError, ...]
    time_s: Numbers

    @classmethod
    def of(cls, validation: BaseWrenchValidation) -> ReactionSection:
        """Return the errors of a predicted base wrench."""
        rows = curve_rows(len(validation.time_s))
        return cls.from_attributes(
            validation,
            components=WrenchError.for_each(
                name=WRENCH_NAMES,
                unit=WRENCH_UNITS,
                rms_error=validation.rms,
                relative_error_percent=validation.relative_percent,
                noise=[None] * 6 if validation.noise is None else validation.noise,
                measured=map(rounded, validation.measured[rows].T),
                predicted=map(rounded, validation.predicted[rows].T),
            ),
            time_s=rounded(validation.time_s[rows] - validation.time_s[0], 7),
        )


class LoadComponent(Section):
    """One component at its largest, in `unit`.

    Attributes:
        name, unit: The component.
        peak, std, limit: Its largest size, the standard deviation of that, and what is allowed.
        at_s: When [s].
        held: Whether the limit holds, two standard deviations included.
    """

    name: str
    unit: str
    peak: float
    std: float
    at_s: float
    limit: float
    held: bool


class BaseLoadSection(Section):
    """What a motion does to the floor.

    Attributes:
        sentence: In words.
        weight_known: Whether the standing weight is in it.
        components: One a component.
    """

    sentence: str
    weight_known: bool
    components: tuple[LoadComponent, ...]

    @classmethod
    def of(cls, load: BaseLoad, more: str = "") -> BaseLoadSection:
        """Return the largest reaction of a motion against its limits; `more` is a sentence."""
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
        """The lines of a verdict on limits of the base."""
        return [
            VerdictCheck.of(
                f"reaction on the base with 2σ, {each.name}",
                each.peak + 2.0 * each.std,
                "≤",
                each.limit,
                each.unit,
            )
            for each in self.components
        ]
