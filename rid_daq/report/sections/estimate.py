"""`EstimateSection`: the parameters of a robot with their intervals, and against the truth."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from identification.regression.fit_grade import Grade
from rid_daq.report.consistency_entry import ConsistencyEntry
from rid_daq.report.mistake_entry import ArmWeightEntry, MistakeEntry
from rid_daq.report.sections.section import Numbers, Section, Texts, finite, units

if TYPE_CHECKING:
    from identification.consistency.consistency_test import ConsistencyTest
    from identification.estimation.estimate import Estimate


class ParameterEntry(Section):
    """One parameter with its standard deviations, in `unit`.

    Attributes:
        name, words, unit: Short, in words, and its unit.
        value, std: The estimate, and the standard deviation to quote.
        std_noise, std_residual: By measured noise alone, and by white residuals; None where they
            are not known.
        truth, deviation_sigmas: Of a simulated robot: the true value, and how far the estimate is
            off, in `std`.
        inside_two_sigma: Whether that is at most two.
        at_bound: True where the fit ended at an end of the parameter's range: the data do not show
            it, and its standard deviation means nothing. Left out elsewhere.
        not_shown: True if it is at a bound, or its interval is as wide as its range. Left out
            elsewhere.
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
    """What the model leaves of an axis' torque.

    Attributes:
        joint, unit: Its name, and the unit of its torque.
        residual: Root mean square, in `unit`.
        noise: Of the measurement; None where there are no periods.
        left_out_fraction: Share of the samples that are not used for friction (standstill).
        torque, percent, over_noise: RMS torque, in `unit`; the residual in percent of it, and over
            the noise. Left out if torques say nothing of the fit.
        held_out_percent: The residual in percent of the torque on parts of the recording that were
            left out of a plain fit, 0 where it is hardly more than on what was fitted; left out
            where nobody looked.
        grade, reason: "good", "doubtful" or "bad", and what decides it.
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


class EstimateSection(Section):
    """The parameters with their intervals, and how they were found.

    Attributes:
        sentence: How, in words.
        method: "periodic" (on the harmonics) or "smoothed" (in the time domain).
        condition_number: Of the scaled equations.
        equations: Their number.
        band_hz: Highest frequency used [Hz].
        periods: Averaged; 0 where the recording is not periodic.
        weighting: "ml", "ls" or "huber".
        unseen: Parameters without any effect on the torques.
        has_truth: Whether the true values are known.
        parameters: Base parameters, then nonlinear ones.
        axes: One an axis.
        findings: What a person should know of it; left out where nobody looked.
        mistakes: Mistakes of wiring, units and files that explain the data far better; left out
            where nobody looked.
        driving: Joints with negative friction power, which no friction has; left out if nobody
            looked.
        arm_weight: How heavy the torques make the arm; left out if they do not tell.
        still: Joints that no run moved, and where they stood [rad or m]; left out if there are
            none.
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
    arm_weight: ArmWeightEntry | None = None
    still: dict[str, Numbers] | None = None
    consistency: ConsistencyEntry | None = None

    @classmethod
    def of(
        cls,
        estimate: Estimate,
        truth: Sequence[float] | np.ndarray[Any, Any] | None = None,
        findings: Sequence[str] | None = None,
        mistakes: tuple[MistakeEntry, ...] | None = None,
        consistency: ConsistencyTest | None = None,
        driving: tuple[str, ...] | None = None,
        arm_weight: ArmWeightEntry | None = None,
    ) -> EstimateSection:
        """Return what is said of an estimate.

        Args:
            truth: Length b. The true base parameters, where the robot is simulated.
            findings: What a person should know of it.
            mistakes: Mistakes that explain the data far better.
            consistency: Its test of physical consistency.
            driving: Joints with negative friction power.
            arm_weight: How heavy the torques make the arm.
        """
        return cls.from_attributes(
            estimate,
            sentence=_sentence(estimate),
            condition_number=float(estimate.condition_number),
            unseen=estimate.base.unseen,
            has_truth=truth is not None,
            parameters=(*_base_parameters(estimate, truth), *_nonlinear_parameters(estimate)),
            axes=tuple(
                AxisResidual(
                    joint=fit.joint,
                    unit=units(joint)[1],
                    residual=fit.residual_nm,
                    noise=fit.noise_nm,
                    left_out_fraction=float(left_out),
                    torque=finite(fit.torque_nm),
                    percent=fit.percent,
                    over_noise=fit.over_noise,
                    held_out_percent=None if share is None else 100.0 * float(share),
                    grade=fit.grade,
                    reason=fit.reason,
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
            findings=None if findings is None else tuple(findings),
            mistakes=mistakes,
            driving=driving,
            arm_weight=arm_weight,
            still={each.joint: each.positions for each in estimate.still} or None,
            consistency=None if consistency is None else ConsistencyEntry.of(consistency),
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
    "external": ", of the reaction on the force plate alone",
    "combined": ", of the torques and the reaction on the force plate",
}


def _sentence(estimate: Estimate) -> str:
    from dynamics.model.memory import presliding  # compiled, and read sections need none of it

    left_out = ", ".join(f"{100.0 * x:.0f}" for x in estimate.left_out_fraction)
    pauses = ""
    if presliding(estimate.model):
        pauses = "; of joints with presliding only the middle of pauses is left out"
    way = {
        "ml": "Least squares weighted by noise (maximum likelihood)",
        "ls": "Least squares without weights",
        "huber": "Robust least squares (Huber) weighted by noise",
    }[estimate.weighting]
    how = (
        f"{way} by QR on the bins up to {estimate.band_hz:g} Hz of {estimate.periods} averaged"
        " periods"
        if estimate.method == "periodic"
        else f"{way} by QR in the time domain; the recording is not periodic, so it is low-passed"
        f" without phase shift at {estimate.band_hz:g} Hz instead of averaged"
    )
    of = (
        "of the mean of the periods in this band, less the torque that is free near standstill"
        if estimate.method == "periodic"
        else "of the low-passed samples that are used"
    )
    return (
        f"{how}{_OUTPUTS[estimate.options.kind]}: {len(estimate.base)} base parameters from"
        f" {estimate.equations} equations,"
        f" condition number {estimate.condition_number:.3g}. Below"
        f" {estimate.standstill_rad_s:g} rad/s friction is not sign(velocity); such samples are not"
        f" used for it{pauses} ({left_out} % of each axis). Torque and residual are RMS"
        f" {of}. Intervals are by leaving out one part"
        " of the data after the other (cluster jackknife), so that they hold for model error as"
        " well; what measured noise or white residuals alone would say stands beside them."
    )
