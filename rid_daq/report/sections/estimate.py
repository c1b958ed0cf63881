"""`EstimateSection`: estimated parameters of a robot with intervals, compared with true values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from identification.regression.fit_grade import Grade
from rid_daq.report.consistency_entry import ConsistencyEntry
from rid_daq.report.mistake_entry import (
    ArmWeightEntry,
    MistakeEntry,
    MovedMassEntry,
    UnconfirmedSection,
)
from rid_daq.report.sections.section import Numbers, Section, Texts, finite_or_none

if TYPE_CHECKING:
    from identification.accuracy.rounded_positions import RoundedPositions
    from identification.consistency.consistency_test import ConsistencyTest
    from identification.estimation.estimate import Estimate
    from identification.wiring.file_entries import UnconfirmedEntry
    from identification.wiring.moved_mass import MovedMass
    from identification.wiring.weight import ArmWeight


class ParameterEntry(Section):
    """One estimated parameter with its standard deviations.

    Attributes:
        name: Short name of the parameter.
        words: The parameter in words, or as a combination of standard parameters.
        unit: Unit of the parameter.
        value: The estimate, in `unit`.
        std: Standard deviation to quote, in `unit`.
        std_noise: Standard deviation due to the measured noise alone, in `unit`; null if it is not
            known.
        std_residual: Standard deviation if the residuals are white, in `unit`; null if it is not
            known.
        truth: True value, in `unit`; left out if it is not known, as for every real robot and for
            every nonlinear parameter.
        deviation_sigmas: Deviation of the estimate from the true value, divided by `std`; left out
            if the true value is not known.
        inside_two_sigma: True if the deviation is at most two standard deviations; left out if the
            true value is not known.
        at_bound: True if the fit ended at a bound of the parameter's range: the data do not
            identify it, and its standard deviation has no meaning. Left out otherwise.
        not_shown: True if the parameter is at a bound, or its interval is as wide as its range.
            Left out otherwise.
    """

    name: str
    words: str
    unit: str
    value: float
    std: float
    std_noise: float | None
    std_residual: float | None
    truth: float | None = None
    deviation_sigmas: float | None = None
    inside_two_sigma: bool | None = None
    at_bound: bool | None = None
    not_shown: bool | None = None


class AxisResidual(Section):
    """Torque residual of an axis.

    Attributes:
        joint: Name of the joint.
        unit: Unit of the torque.
        residual: RMS residual, in `unit`.
        noise: RMS residual that the measured noise alone would cause, in `unit`; null if the
            recording has no periods.
        left_out_fraction: Fraction of the samples that are not used for friction, because the axis
            is at standstill or its friction depends on earlier motion that is not known.
        torque: RMS torque, in `unit`; left out if the estimate does not use torques.
        percent: Residual relative to the torque [%]; left out if the estimate does not use torques,
            or if the torque is 0.
        over_noise: Residual divided by the noise; left out if the noise is not known, or if the
            estimate does not use torques.
        held_out_percent: Residual relative to the torque [%], on parts of the recording that were
            held out of a fit of a simple model (rigid bodies, rotors, Coulomb and viscous friction,
            offset). The value is 0 if the residual is hardly larger than on the fitted parts, and
            for a joint at rest. Left out if it was not computed.
        grade: "good", "doubtful" or "bad"; left out if the joint does not move, or if the estimate
            does not use torques.
        reason: Reason for the grade, or for its absence; always present.
    """

    joint: str
    unit: str
    residual: float
    noise: float | None
    left_out_fraction: float
    torque: float | None = None
    percent: float | None = None
    over_noise: float | None = None
    held_out_percent: float | None = None
    grade: Grade | None = None
    reason: str | None = None


class RoundedPositionsEntry(Section):
    """Rounded positions without recorded velocities, and their effect on the estimate.

    Attributes:
        steps: Rounding step of each joint [rad or m].
        asked_hz: Requested upper limit of the band [Hz].
        band_hz: Upper limit that was used [Hz]; lower than the default limit if that is too high
            for the steps.
        advised_hz: Highest upper limit at which the effect is small [Hz].
        noise_share: Power of the rounding errors' acceleration in the band, relative to that of the
            motion.
        widening: Largest factor by which an interval became wider.
    """

    steps: dict[str, float]
    asked_hz: float
    band_hz: float
    advised_hz: float
    noise_share: float
    widening: float

    @classmethod
    def of(cls, rounded: RoundedPositions) -> RoundedPositionsEntry:
        """Return the entry of rounded positions with their effect."""
        return cls.from_attributes(rounded, steps=rounded.step_of_joint)


@dataclass(frozen=True)
class EstimateChecks:
    """Results of the checks of an estimate.

    Attributes:
        findings: Remarks on the estimate; None if it was not checked.
        mistakes: Probable mistakes in wiring, units and files; None if there was no search.
        driving: Joints with negative friction power; None if this was not checked.
        late_torques: Joints whose recorded torque has a delay that no bus explains, or passed a
            filter; empty if there are none, or if this was not checked.
        clipped_torques: Joints whose recorded torque is clipped; empty if there are none, or if
            this was not checked.
        arm_weight: Weight of the arm implied by the torques; None if they do not determine it, or
            if this was not checked.
        moved_masses: Moving mass and holding force of each prismatic joint that the torques
            determine.
        unconfirmed: Entries of the files that the recordings do not confirm; None if a mistake was
            found, if there are too few data, or if there was no search.
        rounded: Rounded positions with a material effect; None if there are none.
        consistency: Test of physical consistency; None if it was not made.
    """

    findings: tuple[str, ...] | None = None
    mistakes: tuple[MistakeEntry, ...] | None = None
    driving: tuple[str, ...] | None = None
    late_torques: tuple[str, ...] = ()
    clipped_torques: tuple[str, ...] = ()
    arm_weight: ArmWeight | None = None
    moved_masses: tuple[MovedMass, ...] = ()
    unconfirmed: tuple[UnconfirmedEntry, ...] | None = None
    rounded: RoundedPositions | None = None
    consistency: ConsistencyTest | None = None


class EstimateSection(Section):
    """Estimated parameters with their intervals, and the method of the estimate.

    Attributes:
        sentence: Description of the method.
        method: "periodic" (on the harmonics) or "smoothed" (in the time domain).
        condition_number: Condition number of the scaled equations.
        equations: Number of equations.
        band_hz: Highest frequency of the harmonics that are used, or cut-off frequency of the
            low-pass filter [Hz].
        periods: Number of averaged periods; 0 if the recording is not periodic.
        weighting: "ml" (maximum likelihood), "ls" (least squares) or "huber" (robust).
        unseen: Parameters without any effect on the torques.
        has_truth: True if the true values are known.
        parameters: Base parameters, followed by nonlinear parameters.
        axes: Residual of each axis.
        findings: Remarks on the estimate; left out if no checks were made.
        mistakes: Probable mistakes in wiring, units and files: if one is corrected, the model fits
            far better. Left out if no search was made.
        driving: Joints with negative friction power, which is physically impossible; left out if
            this was not checked.
        late_torques: Joints whose recorded torque has a delay that no bus explains, or passed a
            filter that delays it as long; left out if there are none.
        clipped_torques: Joints whose recorded torque does not exceed a limit, although the motion
            demands more; left out if there are none.
        arm_weight: Weight of the arm implied by the torques; left out if the torques do not
            determine it.
        moved_masses: Moving mass and holding force of each prismatic joint; left out if no
            prismatic joint moved.
        unconfirmed: Entries of the files that the recordings do not confirm; left out if a mistake
            was found, if no search was made, or if there are too few data.
        still: Joints that no run moved, and their positions [rad or m]; left out if every joint
            moved.
        rounded_positions: Rounded positions with a material effect; left out if there are none.
        consistency: Test of physical consistency; left out if it was not made.
    """

    sentence: str
    method: Literal["periodic", "smoothed"]
    condition_number: float
    equations: int
    band_hz: float
    periods: int
    weighting: Literal["ml", "ls", "huber"]
    unseen: Texts
    has_truth: bool
    parameters: tuple[ParameterEntry, ...]
    axes: tuple[AxisResidual, ...]
    findings: Texts | None = None
    mistakes: tuple[MistakeEntry, ...] | None = None
    driving: Texts | None = None
    late_torques: Texts | None = None
    clipped_torques: Texts | None = None
    arm_weight: ArmWeightEntry | None = None
    moved_masses: tuple[MovedMassEntry, ...] | None = None
    unconfirmed: tuple[UnconfirmedSection, ...] | None = None
    still: dict[str, Numbers] | None = None
    rounded_positions: RoundedPositionsEntry | None = None
    consistency: ConsistencyEntry | None = None

    @classmethod
    def of(
        cls,
        estimate: Estimate,
        truth: Sequence[float] | np.ndarray[Any, Any] | None = None,
        checks: EstimateChecks | None = None,
    ) -> EstimateSection:
        """Return the section of an estimate.

        Args:
            truth: Length b. True base parameters; None if the robot is not simulated.
            checks: Checks of the estimate; None if none were made.
        """
        checks = checks or EstimateChecks()
        weight, unconfirmed, rounded = checks.arm_weight, checks.unconfirmed, checks.rounded
        return cls.from_attributes(
            estimate,
            sentence=_sentence(estimate),
            condition_number=float(estimate.condition_number),
            unseen=estimate.base.unseen,
            has_truth=truth is not None,
            parameters=(*_base_parameters(estimate, truth), *_nonlinear_parameters(estimate)),
            axes=tuple(
                AxisResidual.from_attributes(
                    fit,
                    unit=joint.torque_unit,
                    residual=fit.residual_nm,
                    noise=fit.noise_nm,
                    left_out_fraction=float(left_out),
                    torque=finite_or_none(fit.torque_nm),
                    held_out_percent=None if share is None else 100.0 * float(share),
                )
                for joint, fit, left_out, share in zip(
                    estimate.robot.joints,
                    estimate.fit,
                    estimate.left_out_fraction,
                    [None] * len(estimate.robot.joints)
                    if estimate.held_out_share is None
                    else estimate.held_out_share,
                    strict=True,
                )
            ),
            findings=checks.findings,
            mistakes=checks.mistakes,
            driving=checks.driving,
            late_torques=checks.late_torques or None,
            clipped_torques=checks.clipped_torques or None,
            arm_weight=None if weight is None else ArmWeightEntry.of(weight),
            moved_masses=tuple(map(MovedMassEntry.of, checks.moved_masses)) or None,
            unconfirmed=None
            if unconfirmed is None
            else tuple(
                UnconfirmedSection.of(each, estimate.robot.joint_names) for each in unconfirmed
            ),
            rounded_positions=None if rounded is None else RoundedPositionsEntry.of(rounded),
            still={each.joint: each.positions for each in estimate.still} or None,
            consistency=None
            if checks.consistency is None
            else ConsistencyEntry.of(checks.consistency),
        )


def _base_parameters(
    estimate: Estimate, truth: Sequence[float] | np.ndarray[Any, Any] | None
) -> list[ParameterEntry]:
    noise = estimate.sigma_noise
    entries = []
    for i, (name, words, unit) in enumerate(
        zip(estimate.base.names, estimate.base.expressions, estimate.base.units, strict=True)
    ):
        value, std = float(estimate.values[i]), float(estimate.sigma[i])
        true = None if truth is None else float(truth[i])
        deviation = None if true is None else (value - true) / std
        entries.append(
            ParameterEntry(
                name=name,
                words=words,
                unit=unit,
                value=value,
                std=std,
                std_noise=None if noise is None else float(noise[i]),
                std_residual=float(estimate.sigma_residual[i]),
                truth=true,
                deviation_sigmas=deviation,
                inside_two_sigma=None if deviation is None else abs(deviation) <= 2.0,
            )
        )
    return entries


def _nonlinear_parameters(estimate: Estimate) -> tuple[ParameterEntry, ...]:
    model, unknown = estimate.model, [None] * len(estimate.model.nonlinear_names)
    return ParameterEntry.for_each(
        name=model.nonlinear_names,
        words=model.nonlinear_names,
        unit=model.nonlinear_units,
        value=model.nonlinear_values,
        std=estimate.nonlinear_sigma,
        std_noise=unknown,
        std_residual=unknown,
        at_bound=[name in model.nonlinear_at_bound or None for name in model.nonlinear_names],
        not_shown=[name in estimate.nonlinear_unseen or None for name in model.nonlinear_names],
    )


_OUTPUTS = {
    "internal": "",
    "external": ", of the base wrench on the force plate alone",
    "combined": ", of the torques and the base wrench on the force plate",
}


def _sentence(estimate: Estimate) -> str:
    # Imported late, because it loads compiled code, which readers of result files do not need.
    from dynamics.model.memory import presliding_of_model
    from identification.elasticity.gear_torque import describe_gear_torque

    gears = ""
    if estimate.gear_torque_nm is not None:
        words = describe_gear_torque(estimate.robot, estimate.gear_torque_nm)
        gears = (
            " The gears are elastic, so the model is that of the links, fitted to their motion. For"
            " the motion of the motors in these runs, rigid gears would need torques that differ"
            f" by {words}."
        )
    left_out = ", ".join(f"{100.0 * x:.0f}" for x in estimate.left_out_fraction)
    pauses = ""
    if presliding_of_model(estimate.model):
        pauses = "; for joints with presliding, only the middle of each pause is left out"
    way = {
        "ml": "Least squares weighted by noise (maximum likelihood)",
        "ls": "Least squares without weights",
        "huber": "Robust least squares (Huber) weighted by noise",
    }[estimate.weighting]
    how = (
        f"{way} by QR on the bins up to {estimate.band_hz:g} Hz of {estimate.periods} averaged"
        " periods"
        if estimate.method == "periodic"
        else f"{way} by QR in the time domain; the recording is not periodic, so it is low-pass"
        f" filtered at {estimate.band_hz:g} Hz without phase shift instead of averaged"
    )
    of = (
        "of the mean of the periods in this band, without the torque near standstill, which the"
        " fit does not use"
        if estimate.method == "periodic"
        else "of the low-pass filtered samples that are used"
    )
    return (
        f"{how}{_OUTPUTS[estimate.options.kind]}: {len(estimate.base)} base parameters from"
        f" {estimate.equations} equations, condition number {estimate.condition_number:.3g}. The"
        f" friction model does not hold below {estimate.standstill_rad_s:g} rad/s, so slower"
        f" samples are not used for friction ({left_out} % of each axis{pauses}). Torque and"
        f" residual are RMS values {of}. Intervals come from leaving out one part of the data at"
        " a time (cluster jackknife), so they include model errors. The standard deviations that"
        f" follow from noise alone and from white residuals are listed next to them.{gears}"
    )
