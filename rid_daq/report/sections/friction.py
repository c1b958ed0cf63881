"""`FrictionSection`: friction measured alone, joint by joint, and the models through it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from identification.regression.fit_grade import FitGrade, Grade, grade_fit
from rid_daq.report.sections.section import Numbers, Section, Texts, units

if TYPE_CHECKING:
    from identification.friction.curve import FrictionCurve
    from identification.friction.fits import FrictionFit
    from identification.validation.estimated_friction import EstimatedFriction

LINE_POINTS = 120


class MeasuredFriction(Section):
    """Friction over speed, one value a speed.

    Attributes:
        speed: [rad/s or m/s].
        odd, odd_std: What changes its sign with the speed, with standard deviations [N m or N].
        forward, backward, direction_std: Both ways alone, where the motion tells them.
    """

    speed: Numbers
    odd: Numbers
    odd_std: Numbers
    forward: Numbers | None
    backward: Numbers | None
    direction_std: Numbers | None

    @classmethod
    def of(cls, curve: FrictionCurve) -> MeasuredFriction:
        """Return what was measured."""
        return cls.from_attributes(
            curve, odd_std=curve.odd_sigma, direction_std=curve.direction_sigma
        )


class FrictionCoefficient(Section):
    """A coefficient of a friction model with its standard deviation, in `unit`."""

    name: str
    value: float
    std: float
    unit: str


class FrictionModel(Section):
    """A friction model fitted to one joint.

    Attributes:
        name: In words.
        terms: As the robot file has them.
        rms: Root mean square error [N m or N].
        misfit: Error in units of the measured variance.
        criterion: Akaike's, corrected for few values.
        parameters: The coefficients.
        at_bound: True where the Stribeck speed ended at a bound, so that the model is not
            recommended. Left out elsewhere.
    """

    name: str
    terms: Texts
    rms: float
    misfit: float
    criterion: float
    parameters: tuple[FrictionCoefficient, ...]
    at_bound: bool | None = None

    @classmethod
    def of(cls, fit: FrictionFit) -> FrictionModel:
        """Return a fitted model."""
        coefficients = FrictionCoefficient.for_each(
            name=fit.parameter_names, value=fit.values, std=fit.sigmas, unit=fit.parameter_units
        )
        return cls.from_attributes(
            fit, rms=fit.rms_nm, parameters=coefficients, at_bound=fit.at_bound or None
        )


class FrictionLines(Section):
    """Models drawn over speed: torque by the model's name."""

    speed: Numbers
    torque: dict[str, Numbers]


class JointFriction(Section):
    """The friction of a joint.

    Attributes:
        joint, unit, torque_unit: Its name, and the units of its position and torque.
        sentence: Which model is best, and what to write into the robot file.
        curve: The measured friction.
        fits: The models, the best first.
        lines: What is drawn of them.
        percent, over_noise: RMS error of the best model in percent of the friction, and over its
            standard deviation.
        grade, reason: "good", "doubtful" or "bad", and what decides it. All four are left out if no
            model was fitted.
    """

    joint: str
    unit: str
    torque_unit: str
    sentence: str
    curve: MeasuredFriction
    fits: tuple[FrictionModel, ...]
    lines: FrictionLines
    percent: float | None = None
    over_noise: float | None = None
    grade: Grade | None = None
    reason: str | None = None


class FrictionSection(Section):
    """Curves, models and what follows from them, joint by joint."""

    sentence: str
    joints: tuple[JointFriction, ...]

    @classmethod
    def of(
        cls,
        curves: Sequence[FrictionCurve],
        fits: Sequence[tuple[FrictionFit, ...]],
        robot: RobotDescription,
        model: EstimatedFriction | None = None,
    ) -> FrictionSection:
        """Return what was measured and fitted.

        Args:
            curves, fits: The measured friction, and the models fitted to it, the best first.
            model: The friction of a model to compare with.
        """
        from identification.friction.fits import CLEARLY_BETTER

        return cls(
            sentence="Half of what turning round changes: gravity and inertia are gone. The"
            " criterion is Akaike's, corrected for few values: small is good, and of models within"
            f" {CLEARLY_BETTER:g} of the smallest the simplest is taken.",
            joints=tuple(
                _joint(curve, own, robot, model, CLEARLY_BETTER)
                for curve, own in zip(curves, fits, strict=True)
            ),
        )

    @property
    def bad_joints(self) -> tuple[str, ...]:
        """The joints whose friction no model explains."""
        return tuple(joint.joint for joint in self.joints if joint.grade is Grade.BAD)


def _joint(
    curve: FrictionCurve,
    fits: tuple[FrictionFit, ...],
    robot: RobotDescription,
    model: EstimatedFriction | None,
    clearly_better: float,
) -> JointFriction:
    j = robot.joint_names.index(curve.joint)
    unit, torque_unit = units(robot.joints[j])
    speed = np.linspace(0.0, 1.05 * float(curve.speed.max()), LINE_POINTS)
    speed[0] = 1e-3 * speed[-1]
    lines = {f"{fit.name} (best)" if fit is fits[0] else fit.name: fit for fit in fits[:2]}
    torque: dict[str, Numbers] = {
        name: tuple(_odd(fit.torque, speed).tolist()) for name, fit in lines.items()
    }
    graded = _graded(curve, fits)
    sentence = _sentence(curve, fits, graded, clearly_better)
    if model is not None:
        torque["the model file"] = tuple(_odd(lambda v: model.torque(j, v), speed).tolist())
        error = curve.odd - _odd(lambda v: model.torque(j, v), curve.speed)
        rms = np.sqrt(np.mean(error**2))
        taken = model.circumstances(j)
        sentence += f" The model file, {taken}, is" if taken else " The model file is"
        sentence += (
            f" off by {rms:.3g} {torque_unit} (rms),"
            f" {100.0 * rms / np.sqrt(np.mean(curve.odd**2)):.2g} %."
        )
    return JointFriction(
        joint=curve.joint,
        unit=unit,
        torque_unit=torque_unit,
        sentence=sentence,
        curve=MeasuredFriction.of(curve),
        fits=tuple(FrictionModel.of(fit) for fit in fits),
        lines=FrictionLines(speed=tuple(speed.tolist()), torque=torque),
        percent=None if graded is None else graded.percent,
        over_noise=None if graded is None else graded.over_noise,
        grade=None if graded is None else graded.grade,
        reason=None if graded is None else graded.reason,
    )


def _graded(curve: FrictionCurve, fits: tuple[FrictionFit, ...]) -> FitGrade | None:
    """Grade the best model by the friction and what is known of it; None without a model."""
    if not fits:
        return None
    rms = [np.array([np.sqrt(np.mean(each**2))]) for each in (curve.odd, curve.odd_sigma)]
    (graded,) = grade_fit((curve.joint,), np.array([fits[0].rms_nm]), *rms, of="friction")
    return graded


def _sentence(
    curve: FrictionCurve,
    fits: tuple[FrictionFit, ...],
    graded: FitGrade | None,
    clearly_better: float,
) -> str:
    """Say which model is best, and what to write into the robot file."""
    if not fits or graded is None:
        return f"{curve.joint}: too few speeds to fit a model; run more of them."
    best = fits[0]
    if graded.grade is Grade.BAD:
        return (
            f"{curve.joint}: no model fits, {best.name} comes closest. Look at the curve in the"
            " report for a warming or slipping joint, and measure again."
        )
    sound = [fit for fit in fits if not fit.at_bound]
    smallest = min((fit.criterion for fit in sound), default=best.criterion)
    close = [fit.name for fit in sound if fit.criterion - smallest < clearly_better]
    close = [name for name in close if name != best.name]
    text = f"{curve.joint}: {best.name} fits best"
    text += f" ({', '.join(close)} not clearly worse)" if close else ""
    speed = next(
        (v for n, v in zip(best.parameter_names, best.values, strict=True) if n[:3] == "vs_"), None
    )
    start = "" if speed is None else f", stribeck_velocity: {speed:.3g}"
    return f"{text}; in the robot file: friction: [{', '.join(best.terms)}]{start}."


def _odd(torque: Callable[[FloatArray], FloatArray], speed: FloatArray) -> FloatArray:
    return np.asarray(0.5 * (torque(speed) - torque(-speed)))
