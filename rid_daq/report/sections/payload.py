"""`PayloadSection`: what a robot carries, with intervals, and whether that is sure enough."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from typing import TYPE_CHECKING, cast

from identification.regression.fit_grade import Grade
from rid_daq.blocks.formats import format_measured
from rid_daq.report.sections.section import Numbers, Section, Texts, units
from rid_daq.report.sections.verdict import Relation, VerdictCheck, VerdictSection

if TYPE_CHECKING:
    from identification.payload.estimate import PayloadEstimate
    from identification.payload.verdict import PayloadResult, Repeats

_PROCEDURES = {
    "together": "Robot and payload estimated together from runs with and without it",
    "difference": "Torques of the same motion with and without the payload, subtracted",
    "model": "Runs with the payload, less the model of the unloaded robot",
    "apart": "The robot identified with the payload and without, and subtracted",
}


class EmptyFlange(StrEnum):
    """How it is known that nothing was on the flange in the runs without payload."""

    SAID = "said"
    BY_FLAG = "by flag"
    SIMULATED = "simulated"


_EMPTY = {
    None: "The runs without payload count as empty: what hung on the flange there is missing from"
    " this mass.",
    EmptyFlange.SAID: "As you said, nothing was on the flange in the run without payload: what hung"
    " there all the same is missing from this mass.",
    EmptyFlange.BY_FLAG: "Nobody was asked whether the flange was empty in the run without payload"
    " (--yes): what hung there is missing from this mass.",
    EmptyFlange.SIMULATED: "Nothing was on the simulated flange in the run without payload.",
}


class PayloadParameter(Section):
    """A parameter of a payload with standard deviations, in `unit`.

    Attributes:
        name, unit: Its name and unit.
        value, std, std_noise: The estimate, the standard deviation to quote, and that by noise;
            None where the motion does not show it.
        known: Whether it was given.
        exported: Of the closest body that can exist; left out where not all parameters are seen.
    """

    name: str
    unit: str
    value: float | None
    std: float | None
    std_noise: float | None
    known: bool
    exported: float | None = None


class PrincipalMoment(Section):
    """A principal moment of inertia [kg m^2], and the axis that it is about."""

    moment: float
    axis: Numbers


class PayloadRepeats(Section):
    """The payload from each loaded run alone.

    Attributes:
        runs: So many.
        ratio: Their scatter over the quoted standard deviation, all parameters together.
        scatter: Standard deviation between runs, one a parameter.
    """

    runs: int
    ratio: float
    scatter: Numbers


class PayloadAxis(Section):
    """What an axis sees of the payload.

    Attributes:
        joint, unit: Its name, and the unit of its torque.
        payload, residual: Torque of the payload, and the residual (RMS), in `unit`.
        residual_percent: The residual, of the axis' torque [%].
        noise, over_noise: What the measured noise alone leaves, in `unit`, and the residual over
            it; None if it is not measured.
        grade, reason: "good", "doubtful" or "bad", and what decides it.
        mass_per_percent: By how much the mass changes for 1 % of this axis' torque [kg]; None where
            that is not told, as by `apart`.
    """

    joint: str
    unit: str
    payload: float
    residual: float
    mass_per_percent: float | None
    residual_percent: float
    noise: float | None = None
    over_noise: float | None = None
    grade: Grade | None = None
    reason: str


class PayloadSection(Section):
    """A payload with its intervals, principal axes, findings and torques.

    Attributes:
        sentence, procedure: How it was found.
        equations, rank: Their number, and the number of parameters that they show.
        condition_number: Of the equations.
        parameters: Mass, centre of gravity, inertia.
        principal: None where not all parameters are seen.
        repeats: None where there is one loaded run.
        findings: What a person should know.
        axes: One an axis.
        existence: Whether such a body can exist; left out where not all parameters are seen.
    """

    sentence: str
    procedure: str
    equations: int
    condition_number: float
    rank: int
    parameters: tuple[PayloadParameter, ...]
    principal: tuple[PrincipalMoment, ...] | None
    repeats: PayloadRepeats | None
    findings: Texts
    axes: tuple[PayloadAxis, ...]
    existence: str | None = None

    @classmethod
    def of(
        cls, payload: PayloadResult, repeats: Repeats | None, findings: Sequence[str] = ()
    ) -> PayloadSection:
        """Return what is said of a payload.

        Args:
            repeats: The same from each loaded run alone.
            findings: What else a person should know.
        """
        from identification.payload.findings import payload_findings

        estimate = payload.estimate
        whole = estimate.rank == len(estimate.values)
        mistakes = dict.fromkeys(line.advice for line in payload.checks if not line.passed)
        own = (f"{finding.sentence}." for finding in payload_findings(estimate))
        return cls.from_attributes(
            estimate,
            sentence=_sentence(estimate),
            parameters=_parameters(estimate, whole),
            principal=_principal(estimate) if whole else None,
            repeats=None
            if repeats is None
            else PayloadRepeats.from_attributes(
                repeats, runs=len(repeats.values), scatter=repeats.scatter
            ),
            findings=(*filter(None, mistakes), *own, *findings),
            axes=PayloadAxis.for_each(
                joint=estimate.robot.joint_names,
                unit=[units(joint)[1] for joint in estimate.robot.joints],
                payload=estimate.payload_nm,
                residual=estimate.residual_nm,
                mass_per_percent=[None] * len(estimate.robot.joints)
                if estimate.procedure == "apart"
                else 0.01 * estimate.gain_effects[0],
                residual_percent=100.0 * estimate.residual_share,
                noise=[fit.noise_nm for fit in estimate.fit],
                over_noise=[fit.over_noise for fit in estimate.fit],
                grade=[fit.grade for fit in estimate.fit],
                reason=[fit.reason for fit in estimate.fit],
            ),
            existence=_existence(estimate) if whole else None,
        )

    @property
    def has_centre(self) -> bool:
        """Whether enough is known of the centre of gravity to draw where it lies."""
        return sum(each.value is not None for each in self.parameters[1:4]) >= 2


def payload_verdict(payload: PayloadResult, empty: EmptyFlange | None = None) -> VerdictSection:
    """Return whether a payload is as sure as was asked for.

    Args:
        empty: How it is known that nothing hung on the flange without it; None where nobody was
            asked.
    """
    estimate = payload.estimate
    checks = [
        VerdictCheck.of(
            line.text, line.value, cast("Relation", line.relation), line.limit, line.unit
        )
        for line in payload.checks
    ]
    failed = [line.text for line in checks if not line.passed]
    mass = (
        f"{_mass(estimate)} (2σ)" if estimate.seen[0] else "a mass that this motion does not show"
    )
    headline = (
        f"Failed: {'; '.join(failed)}"
        if failed
        else f"Passed: the payload has {mass.split(' (')[0]}"
    )
    sentence = "Load data are exported where this verdict is passed."
    if failed:
        sentence = f"Mass: {mass}. {sentence}"
    if estimate.procedure != "model":
        sentence += f" {_EMPTY[empty]}"
    if estimate.seen[0]:
        known = 100.0 * estimate.torque_constant_sigma
        sentence += (
            f" Each torque constant counts as known to {known:.2g} % (1 σ): 1 % of all of them is"
            f" {0.01 * abs(estimate.reported[0]):.2g} kg."
        )
    return VerdictSection.of(checks, headline, sentence)


def _parameters(estimate: PayloadEstimate, whole: bool) -> tuple[PayloadParameter, ...]:
    from identification.choices import REPORTED
    from identification.payload.body import REPORTED_UNITS

    known = {quantity.name for quantity in estimate.known}
    return tuple(
        PayloadParameter(
            name=name,
            unit=unit,
            value=float(estimate.reported[i]) if estimate.seen[i] else None,
            std=float(estimate.sigma[i]) if estimate.seen[i] else None,
            std_noise=float(estimate.sigma_noise[i]) if estimate.seen[i] else None,
            known=name in known,
            exported=float(estimate.body.reported[i]) if whole else None,
        )
        for i, (name, unit) in enumerate(zip(REPORTED, REPORTED_UNITS, strict=True))
    )


def _principal(estimate: PayloadEstimate) -> tuple[PrincipalMoment, ...]:
    moments, axes = estimate.body.principal
    return PrincipalMoment.for_each(moment=moments, axis=axes.T)


def _existence(estimate: PayloadEstimate) -> str:
    p = estimate.consistent[1]
    if p == 1.0:
        return "A body with these parameters can exist."
    explains = "explains" if estimate.can_exist else "DOES NOT explain"
    return (
        "No body has exactly these parameters; the closest one that can exist"
        f" {explains} the data (p = {p:.2g})."
    )


def _mass(estimate: PayloadEstimate) -> str:
    value, reach = format_measured(float(estimate.reported[0]), 2.0 * float(estimate.sigma[0]))
    return f"{value} kg ± {reach} kg"


def _known(name: str, value: float, reach: float) -> str:
    shown, around = format_measured(value, reach)
    return f"{name} = {shown} ± {around} (2σ)"


def _sentence(estimate: PayloadEstimate) -> str:
    held = ", ".join(_known(k.name, k.value, 2.0 * k.sigma) for k in estimate.known)
    return (
        f"{_PROCEDURES[estimate.procedure]}: {estimate.equations} equations, friction free in each"
        f" run, condition number {estimate.condition_number:.3g}"
        + (f"; known: {held}." if held else ".")
    )
