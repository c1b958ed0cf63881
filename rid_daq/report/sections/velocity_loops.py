"""`VelocityLoopsSection`: the drives' velocity loops, measured and fitted, with their margins."""

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
from rid_daq.report.sections.section import Numbers, Section, Texts, finite, units

if TYPE_CHECKING:
    from compensation.loops.cascade import Cascade, GainAdvice
    from compensation.loops.frequency_response import FrequencyResponse
    from compensation.loops.loop_measurement import LoopMeasurement

SMALLEST_P = 0.001
LARGEST_MISFIT = 0.3


class LoopTrialSection(Section):
    """A candidate of the controller: terms beside the PI, cost, and two criteria."""

    extras: Texts
    cost: float
    aic: float
    mdl: float


class AxisLoop(Section):
    """One axis: its velocity controller, its mechanics, and its cascade.

    Attributes:
        joint, unit, inertia_unit: Its name, and the units of gain and damping, and of inertia.
        gain, integral_time_s, delay_s, lag_s: Of the controller; `gain` in `unit`, the others in
            seconds.
        std: Standard deviation of each parameter that was fitted, by its name.
        covariance: Of the same, in the same order.
        p_value, whiteness: Probability of a misfit as large by noise alone, and of misfits as alike
            on neighbours.
        trials: The candidates.
        inertia, damping: Apparent ones of the axis. They have no interval: friction that holds and
            other joints that give way bias them by more than the noise. With them the share that is
            not explained (`mechanics_misfit`), and what noise alone leaves of it
            (`mechanics_noise`).
        velocity_margins, position_margins: Of the two loops.
        position_peak: Largest amplification of the closed position loop.
        largest_position_gain_per_s: That keeps the margins [1/s].
        response, mechanics_response, cascade: The curves.
        findings: What is wrong, if anything.
        grade, reason: "good", "doubtful" or "bad" by the share that the mechanics leave
            unexplained, and what decides it.
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
        """What an inertia leaves of torque over speed, beside the noise."""
        left = f"an inertia leaves {100.0 * self.mechanics_misfit:.2g} % of torque over speed"
        if self.mechanics_noise:
            over = number(self.mechanics_misfit / self.mechanics_noise, 2)
            left += f", {over} times what noise alone does"
        return left

    @classmethod
    def of(
        cls,
        robot: RobotDescription,
        controller: FrequencyResponse,
        mechanics: FrequencyResponse,
        cascade: Cascade,
    ) -> AxisLoop:
        """Return what was measured and fitted of an axis."""
        loop, axis = cascade.loop, cascade.mechanics
        position_unit, torque_unit = units(robot.joints[robot.joint_names.index(loop.joint_name)])
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
            largest_position_gain_per_s=finite(cascade.largest_position_gain_per_s),
            response=ControllerResponse.of(controller, loop),
            mechanics_response=MechanicsResponse.of(mechanics),
            cascade=CascadeCurves.of(controller, mechanics, cascade),
            findings=tuple(_findings(controller, cascade)),
            grade=fit.grade,
            reason=fit.reason,
            mechanics_noise=axis.noise,
        )


class VelocityLoopsSection(Section):
    """Responses, fitted controllers, margins and advice, axis by axis.

    Attributes:
        sentence: How they were measured.
        position_gain_per_s, largest_position_gain_per_s: Now, and the largest that keeps the
            margins of all axes [1/s].
        advice: About the position gain.
        axes: One an axis.
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
        """Return what was measured of the loops.

        Args:
            robot: The robot, for units.
            measured: Responses and fits.
            advice: About the position gain.
        """
        return cls(
            sentence=_sentence(measured),
            position_gain_per_s=advice.present_per_s,
            largest_position_gain_per_s=finite(advice.largest_per_s),
            advice=advice.sentence,
            axes=tuple(
                AxisLoop.of(robot, controller, axis, cascade)
                for controller, axis, cascade in zip(
                    measured.controllers, measured.mechanics, measured.cascades, strict=True
                )
            ),
        )

    @property
    def bad_joints(self) -> tuple[str, ...]:
        """The joints whose measured response the fitted loop does not explain."""
        return tuple(axis.joint for axis in self.axes if axis.grade is Grade.BAD)


def _sentence(measured: LoopMeasurement) -> str:
    first, left_out = measured.controllers[0], measured.left_out
    sentence = (
        f"{first.realisations} realisations of {first.periods} periods. Intervals are two standard"
        " deviations, from what differs between periods and between realisations. Gain and integral"
        " time are fitted to the complex response by maximum likelihood; delay and lag are taken"
        " into the fit where the description length gets shorter by them."
    )
    if left_out:
        numbers = ", ".join(str(k) for k in left_out)
        sentence += f" Left out, because rows are missing: realisation {numbers}."
    if first.realisations == 1:
        sentence += " One realisation cannot tell nonlinear distortion from the response."
    return sentence


def _findings(measured: FrequencyResponse, cascade: Cascade) -> list[str]:
    """Say what is wrong, if anything."""
    loop, found = cascade.loop, []
    if loop.p_value < SMALLEST_P:
        found.append(
            "a proportional-integral controller does not explain what was measured: look for"
            " filters in the drive, or excite less"
        )
    if loop.whiteness < SMALLEST_P:
        found.append(
            "what the fit leaves is alike on neighbouring lines: a term is missing, such as a"
            " filter or a second delay"
        )
    weak = measured.frequency_hz[measured.coherence < 0.5]
    if len(weak):
        where = ", ".join(f"{f:.3g}" for f in weak)
        found.append(
            f"torque follows the multisine badly (coherence below 0.5) at {where} Hz: these lines"
            " hardly count; excite more, or start the band higher"
        )
    if cascade.mechanics.misfit > LARGEST_MISFIT:
        found.append(
            f"the axis is not one inertia (misfit {100.0 * cascade.mechanics.misfit:.0f} %):"
            " elastic, or stuck; its margins do not hold"
        )
    return found
