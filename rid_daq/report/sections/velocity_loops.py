"""`VelocityLoopsSection`: measured and fitted velocity loops of the drives, with margins."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from config.robot.robot import RobotDescription
from identification.regression.fit_grade import Grade, grade_fit
from rid_daq.blocks.formats import number
from rid_daq.report.sections.loop_curves import (
    CascadeCurves,
    ControllerResponse,
    LoopMargins,
    MechanicsResponse,
)
from rid_daq.report.sections.section import Numbers, Section, Texts, finite_or_none

if TYPE_CHECKING:
    from compensation.loops.cascade import Cascade, GainAdvice
    from compensation.loops.frequency_response import FrequencyResponse
    from compensation.loops.loop_measurement import LoopMeasurement

LARGEST_MISFIT = 0.3


class LoopTrialSection(Section):
    """One candidate model of the velocity controller.

    Attributes:
        extras: Terms in addition to the PI controller.
        cost: Cost of the fit.
        aic: Akaike's information criterion.
        mdl: Minimum description length.
    """

    extras: Texts
    cost: float
    aic: float
    mdl: float


class AxisLoop(Section):
    """Velocity controller, mechanics and cascade of one axis.

    Attributes:
        joint: Name of the joint.
        unit: Unit of gain and damping.
        inertia_unit: Unit of the inertia.
        gain: Proportional gain of the controller, in `unit`.
        integral_time_s: Integral time of the controller [s].
        delay_s: Delay of the controller [s].
        lag_s: Time constant of the controller's lag [s].
        std: Standard deviation of each fitted parameter, by its name.
        covariance: Covariance of the fitted parameters, in the order of `std`.
        p_value: Probability that noise alone causes a misfit at least as large.
        whiteness: Probability that noise alone makes the misfits at neighbouring frequency lines at
            least as similar.
        trials: The candidate models.
        inertia: Apparent inertia of the axis. It has no interval: stiction and the motion of other
            joints bias it by more than the noise.
        damping: Apparent damping of the axis, biased as the inertia is.
        mechanics_misfit: Fraction of the axis's response that inertia and damping do not explain.
        mechanics_noise: The fraction that noise alone would leave unexplained.
        velocity_margins: Margins of the velocity loop.
        position_margins: Margins of the position loop.
        position_peak: Largest amplification of the closed position loop.
        largest_position_gain_per_s: Largest position gain that keeps the margins [1/s]; null if
            every gain keeps them.
        response: Measured response of the controller.
        mechanics_response: Measured response of the axis.
        cascade: Curves of the open loops.
        findings: Problems of the measurement or the fit; empty without problems.
        grade: "good", "doubtful" or "bad", by the fraction `mechanics_misfit`.
        reason: Reason for the grade.
    """

    joint: str
    unit: str
    gain: float
    integral_time_s: float
    delay_s: float
    lag_s: float
    std: dict[str, float]
    covariance: tuple[Numbers, ...]
    p_value: float
    whiteness: float
    trials: tuple[LoopTrialSection, ...]
    inertia: float
    inertia_unit: str
    damping: float
    mechanics_misfit: float
    velocity_margins: LoopMargins
    position_margins: LoopMargins
    position_peak: float
    largest_position_gain_per_s: float | None
    response: ControllerResponse
    mechanics_response: MechanicsResponse
    cascade: CascadeCurves
    findings: Texts
    grade: Grade | None = None
    reason: str
    mechanics_noise: float

    @property
    def left_words(self) -> str:
        """Phrase with the fraction of the response that inertia and damping do not explain."""
        left = (
            f"inertia and damping leave {100.0 * self.mechanics_misfit:.2g} % of the response"
            " (torque to speed) unexplained"
        )
        if self.mechanics_noise:
            over = number(self.mechanics_misfit / self.mechanics_noise, 2)
            left += f", {over} times as much as noise alone would leave"
        return left

    @classmethod
    def of(
        cls,
        robot: RobotDescription,
        controller: FrequencyResponse,
        mechanics: FrequencyResponse,
        cascade: Cascade,
        unexplained: float,
    ) -> AxisLoop:
        """Return the measurements and fits of one axis."""
        loop, axis = cascade.loop, cascade.mechanics
        joint = robot.joints[robot.joint_names.index(loop.joint_name)]
        position_unit, torque_unit = joint.unit, joint.torque_unit
        (fit,) = grade_fit(
            (loop.joint_name,),
            np.array([axis.misfit]),
            np.ones(1),
            np.array([axis.noise]),
            of="mechanics' response",
        )
        return cls.from_attributes(
            loop,
            joint=loop.joint_name,
            unit=f"{torque_unit} s/{position_unit}",
            std=loop.sigma,
            trials=tuple(LoopTrialSection.from_attributes(trial) for trial in loop.trials),
            inertia=axis.inertia,
            inertia_unit="kg m^2" if position_unit == "rad" else "kg",
            damping=axis.damping,
            mechanics_misfit=axis.misfit,
            velocity_margins=LoopMargins.from_attributes(cascade.velocity_margins),
            position_margins=LoopMargins.from_attributes(cascade.position_margins),
            position_peak=cascade.peak,
            largest_position_gain_per_s=finite_or_none(cascade.largest_position_gain_per_s),
            response=ControllerResponse.of(controller, loop),
            mechanics_response=MechanicsResponse.of(mechanics),
            cascade=CascadeCurves.of(controller, mechanics, cascade),
            findings=tuple(_findings(controller, cascade, unexplained)),
            grade=fit.grade,
            reason=fit.reason,
            mechanics_noise=axis.noise,
        )


class VelocityLoopsSection(Section):
    """Responses, fitted controllers, margins and advice, axis by axis.

    Attributes:
        sentence: Description of the measurement.
        position_gain_per_s: Present position gain [1/s].
        largest_position_gain_per_s: Largest position gain that keeps the margins of all axes [1/s];
            null if every gain keeps them, 0 if the measurement is too uncertain.
        advice: Advice on the position gain.
        axes: Result of each axis.
    """

    sentence: str
    position_gain_per_s: float
    largest_position_gain_per_s: float | None
    advice: str
    axes: tuple[AxisLoop, ...]

    @classmethod
    def of(
        cls, robot: RobotDescription, measured: LoopMeasurement, advice: GainAdvice
    ) -> VelocityLoopsSection:
        """Return the section of measured velocity loops.

        Args:
            robot: Robot with the units.
            measured: Responses and fits.
            advice: Advice on the position gain.
        """
        return cls(
            sentence=_sentence(measured),
            position_gain_per_s=advice.present_per_s,
            largest_position_gain_per_s=finite_or_none(advice.largest_per_s),
            advice=advice.sentence,
            axes=tuple(
                AxisLoop.of(robot, *each)
                for each in zip(
                    measured.controllers,
                    measured.mechanics,
                    measured.cascades,
                    measured.unexplained,
                    strict=True,
                )
            ),
        )

    @property
    def bad_joints(self) -> tuple[str, ...]:
        """The joints whose response (torque to speed) inertia and damping do not explain."""
        return tuple(axis.joint for axis in self.axes if axis.grade is Grade.BAD)


def _sentence(measured: LoopMeasurement) -> str:
    first, left_out = measured.controllers[0], measured.left_out
    sentence = (
        f"{first.realisations} realisations of {first.periods} periods. Intervals are two"
        " standard deviations, from the differences between periods and between realisations."
        " Gain and integral time are fitted to the complex response by maximum likelihood. Delay"
        " and lag are included in the fit if they shorten the description length."
    )
    if left_out:
        numbers = ", ".join(str(k) for k in left_out)
        sentence += f" Realisations left out because rows are missing: {numbers}."
    if first.realisations == 1:
        sentence += " One realisation cannot separate nonlinear distortion from the response."
    return sentence


def _findings(measured: FrequencyResponse, cascade: Cascade, unexplained: float) -> list[str]:
    """Return the problems of the fit; empty without problems."""
    loop, found = cascade.loop, []
    if unexplained:
        found.append(
            f"at frequencies without excitation, {100.0 * unexplained:.2g} % of the torque differ"
            " from that of the controller; the intervals contain this as an error. If it is more"
            " than 1 %, check that no torque was limited or clipped (reduce the amplitude)"
        )
    if not loop.is_explained:
        found.append(
            "a proportional-integral controller does not explain the measured response: look for"
            " filters in the drive, or reduce the excitation"
        )
    if not loop.is_complete:
        found.append(
            "the residual of the fit is similar on neighbouring lines: a term is missing, such"
            " as a filter or a second delay"
        )
    weak = measured.frequency_hz[measured.coherence < 0.5]
    if len(weak):
        where = ", ".join(f"{f:.3g}" for f in weak)
        found.append(
            f"the torque follows the multisine poorly (coherence below 0.5) at {where} Hz, so"
            " these lines have little weight: increase the excitation, or start the band at a"
            " higher frequency"
        )
    if cascade.mechanics.misfit > LARGEST_MISFIT:
        found.append(
            "the axis does not behave as one inertia (misfit"
            f" {100.0 * cascade.mechanics.misfit:.0f} %); it may be elastic or stuck, and its"
            " margins are not valid"
        )
    return found
