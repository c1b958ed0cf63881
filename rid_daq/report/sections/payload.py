"""`PayloadSection`: an estimated payload with intervals, and the verdict on its accuracy."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from typing import TYPE_CHECKING, cast

from identification.regression.fit_grade import Grade
from rid_daq.blocks.formats import format_measured
from rid_daq.report.sections.section import Numbers, Section, Texts
from rid_daq.report.sections.verdict import Relation, VerdictCheck, VerdictSection

if TYPE_CHECKING:
    from identification.payload.estimate import PayloadEstimate
    from identification.payload.verdict import PayloadResult, Repeats

_PROCEDURES = {
    "together": "Robot and payload estimated together from runs with and without the payload",
    "difference": "Payload estimated from the difference of the torques of one motion with and"
    " without it",
    "model": "Payload estimated from the torques of runs with it, minus those of a model of the"
    " robot without payload",
    "apart": "Robot identified with and without the payload; the payload is the difference of the"
    " two results",
}


class EmptyFlange(StrEnum):
    """Evidence that the flange was empty in the runs without payload."""

    SAID = "said"
    BY_FLAG = "by flag"
    SIMULATED = "simulated"


_EMPTY = {
    None: "The program assumes that the flange was empty in the runs without payload. If it"
    " carried a load, this mass is too small by the mass of that load.",
    EmptyFlange.SAID: "You confirmed that the flange was empty in the run without payload. If it"
    " carried a load nevertheless, this mass is too small by the mass of that load.",
    EmptyFlange.BY_FLAG: "The option --yes skipped the question whether the flange was empty in"
    " the run without payload. If it carried a load, this mass is too small by the mass of that"
    " load.",
    EmptyFlange.SIMULATED: "The simulated flange was empty in the run without payload.",
}


class PayloadParameter(Section):
    """One parameter of a payload with its standard deviations.

    Attributes:
        name: Name of the parameter.
        unit: Unit of the parameter.
        value: The estimate, in `unit`; null if the motion does not identify it.
        std: Standard deviation to quote, in `unit`; null if the motion does not identify the
            parameter.
        std_noise: Standard deviation due to noise alone, in `unit`; the residual counts as noise if
            the runs are not periodic. Null if the motion does not identify the parameter.
        known: True if the user stated the value.
        exported: Value of the closest physically consistent body, in `unit`; left out unless all
            parameters are identified.
    """

    name: str
    unit: str
    value: float | None
    std: float | None
    std_noise: float | None
    known: bool
    exported: float | None = None


class PrincipalMoment(Section):
    """A principal moment of inertia and its axis.

    Attributes:
        moment: Moment of inertia [kg m^2].
        axis: Unit vector of the axis in the flange's frame.
    """

    moment: float
    axis: Numbers


class PayloadRepeats(Section):
    """Scatter of the payload between estimates from single runs with the payload.

    Attributes:
        runs: Number of runs with the payload.
        ratio: Scatter divided by the quoted standard deviation, for all parameters together.
        scatter: Standard deviation between runs, one value per parameter.
    """

    runs: int
    ratio: float
    scatter: Numbers


class PayloadAxis(Section):
    """Torque of the payload and residual on one axis.

    Attributes:
        joint: Name of the joint.
        unit: Unit of the torque.
        payload: RMS torque of the payload, in `unit`.
        residual: RMS residual, in `unit`.
        mass_per_percent: Change of the mass if this axis's torque changes by 1 % [kg]; null for
            procedure `apart`.
        residual_percent: Residual relative to the axis's torque [%]; if the axis has little torque,
            relative to a fixed fraction of its limit.
        noise: RMS residual that the measured noise alone would cause, in `unit`; left out if the
            noise was not measured.
        over_noise: Residual divided by `noise`; left out if the noise was not measured.
        grade: "good", "doubtful" or "bad"; left out if the axis has no torque.
        reason: Reason for the grade, or for its absence.
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
        sentence: Description of the method.
        procedure: Name of the method.
        equations: Number of equations.
        condition_number: Condition number of the equations.
        rank: Number of parameters that the equations determine.
        parameters: Mass, centre of gravity, inertia.
        principal: Principal moments of inertia; null unless all parameters are identified.
        repeats: Scatter between runs with the payload; null if there is only one such run, for the
            procedure `difference`, and unless all parameters are identified.
        findings: Remarks on the payload.
        axes: Torque and residual of each axis.
        existence: A sentence on physical consistency; left out unless all parameters are
            identified.
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
        """Return the section of a payload.

        Args:
            payload: The estimate with its checks.
            repeats: Estimates from each run with the payload alone.
            findings: Additional remarks.
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
                unit=[joint.torque_unit for joint in estimate.robot.joints],
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
        """True if at least two coordinates of the centre of gravity are known."""
        return sum(each.value is not None for each in self.parameters[1:4]) >= 2


def payload_verdict(payload: PayloadResult, empty: EmptyFlange | None = None) -> VerdictSection:
    """Return the verdict on a payload: passed if it is as accurate as required.

    Args:
        empty: Evidence that the flange was empty in the runs without payload; None if the user was
            not asked.
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
        f"{_mass(estimate)} (2σ)"
        if estimate.is_determined[0]
        else "not identifiable from this motion"
    )
    headline = (
        f"Failed: {'; '.join(failed)}"
        if failed
        else f"Passed: the payload's mass is {mass.split(' (')[0]}"
    )
    sentence = "Load data are exported only if this verdict is passed."
    if failed:
        sentence = f"Mass: {mass}. {sentence}"
    if estimate.procedure != "model":
        sentence += f" {_EMPTY[empty]}"
    if estimate.is_determined[0]:
        known = 100.0 * estimate.torque_constant_sigma
        sentence += (
            f" Each torque constant is assumed to be known to {known:.2g} % (1 σ): an error of 1"
            f" % in every constant changes the mass by {0.01 * abs(estimate.reported[0]):.2g} kg."
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
            value=float(estimate.reported[i]) if estimate.is_determined[i] else None,
            std=float(estimate.sigma[i]) if estimate.is_determined[i] else None,
            std_noise=float(estimate.sigma_noise[i]) if estimate.is_determined[i] else None,
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
        return "The parameters are physically consistent: a body with them can exist."
    explains = "explains" if estimate.is_consistent else "DOES NOT explain"
    return (
        "The parameters are not physically consistent; the closest body that can exist"
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
        f"{_PROCEDURES[estimate.procedure]}: {estimate.equations} equations, friction estimated"
        f" separately for each run, condition number {estimate.condition_number:.3g}"
        + (f"; known: {held}." if held else ".")
    )
