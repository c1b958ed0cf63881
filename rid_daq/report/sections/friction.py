"""`FrictionSection`: friction measured joint by joint, and the models fitted to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from identification.regression.fit_grade import FitGrade, Grade, grade_fit
from rid_daq.report.sections.section import Numbers, Section, Texts

if TYPE_CHECKING:
    from identification.friction.curve import FrictionCurve
    from identification.friction.fits import FrictionFit
    from identification.validation.estimated_friction import EstimatedFriction

LINE_POINTS = 120


class MeasuredFriction(Section):
    """Measured friction of a joint, one value per speed.

    Attributes:
        speed: Speeds [rad/s or m/s].
        odd: Odd part of the friction, which changes its sign with the direction [N m or N].
        odd_std: Standard deviation of `odd` [N m or N].
        forward: Friction in the forward direction [N m or N]; null if the motion does not separate
            the directions.
        backward: Friction in the backward direction [N m or N]; null if the motion does not
            separate the directions.
        direction_std: Standard deviation of `forward` and `backward` [N m or N]; null if the motion
            does not separate the directions.
    """

    speed: Numbers
    odd: Numbers
    odd_std: Numbers
    forward: Numbers | None
    backward: Numbers | None
    direction_std: Numbers | None

    @classmethod
    def of(cls, curve: FrictionCurve) -> MeasuredFriction:
        """Return the values of a friction curve."""
        return cls.from_attributes(
            curve, odd_std=curve.odd_sigma, direction_std=curve.direction_sigma
        )


class ComparedFriction(Section):
    """Friction of the same joint in another run.

    Attributes:
        label: Label of the run.
        curve: The measured friction.
        percent: Mean difference from the run itself, relative to the friction of the run itself, in
            the range of speeds of both runs [%]; left out if the ranges do not overlap.
    """

    label: str
    curve: MeasuredFriction
    percent: float | None = None

    @classmethod
    def of(cls, label: str, curve: FrictionCurve, own: FrictionCurve) -> ComparedFriction:
        """Compare a curve with that of the run itself, interpolated at the same speeds.

        Args:
            label: Label of the compared run.
            curve: Its friction.
            own: Friction of the run itself.
        """
        shared = (curve.speed >= own.speed[0]) & (curve.speed <= own.speed[-1])
        percent = None
        if shared.any():
            here = np.interp(curve.speed[shared], own.speed, own.odd)
            percent = float(100.0 * (np.mean(curve.odd[shared]) / np.mean(here) - 1.0))
        return cls(label=label, curve=MeasuredFriction.of(curve), percent=percent)


class FrictionCoefficient(Section):
    """A coefficient of a friction model.

    Attributes:
        name: Name of the coefficient.
        value: Estimate, in `unit`.
        std: Standard deviation, in `unit`.
        unit: Unit of the coefficient.
    """

    name: str
    value: float
    std: float
    unit: str


class FrictionModel(Section):
    """A friction model fitted to one joint.

    Attributes:
        name: Name of the model in words.
        terms: Friction terms as written in the robot file.
        rms: RMS error of the fit [N m or N].
        misfit: Mean squared error in units of the measured variance.
        criterion: Akaike's information criterion, corrected for small samples (AICc).
        parameters: The coefficients.
        at_bound: True if the Stribeck speed ended at its bound, so that the model is not
            recommended. Left out otherwise.
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
    """Curves of the models over speed.

    Attributes:
        speed: Speeds [rad/s or m/s].
        torque: Friction of each model at these speeds, by the model's name [N m or N].
    """

    speed: Numbers
    torque: dict[str, Numbers]


class JointFriction(Section):
    """Measured friction and fitted models of one joint.

    Attributes:
        joint: Name of the joint.
        unit: Unit of the joint's position.
        torque_unit: Unit of the joint's torque.
        sentence: The best model, and the lines for the robot file.
        curve: The measured friction.
        fits: The models, the best first.
        lines: Curves of the two best models and, if one was given, of the model file.
        percent: RMS error of the best model relative to the friction [%]; left out without a model.
        over_noise: RMS error of the best model divided by the noise; left out without a model.
        grade: "good", "doubtful" or "bad"; left out without a model.
        reason: Reason for the grade; left out without a model.
        beside: Friction in other runs; left out without any.
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
    beside: tuple[ComparedFriction, ...] | None = None


class FrictionSection(Section):
    """Measured friction and fitted models of all joints.

    Attributes:
        sentence: Description of the measurement.
        joints: Result of each joint.
    """

    sentence: str
    joints: tuple[JointFriction, ...]

    @classmethod
    def of(
        cls,
        curves: Sequence[FrictionCurve],
        fits: Sequence[tuple[FrictionFit, ...]],
        robot: RobotDescription,
        model: EstimatedFriction | None = None,
        beside: Mapping[str, Sequence[ComparedFriction]] | None = None,
    ) -> FrictionSection:
        """Return the section of measured friction.

        Args:
            curves: Measured friction of each joint.
            fits: Models fitted to each curve, the best first.
            model: Friction of an estimated model to compare with.
            beside: Friction of joints in other runs, by the joint's name.
        """
        from identification.friction.fits import CLEARLY_BETTER

        return cls(
            sentence="Friction is half the difference between the torques of the two directions;"
            " gravity and inertia cancel. The criterion is Akaike's, corrected for small samples"
            f" (AICc): smaller is better. Of all models within {CLEARLY_BETTER:g} of the smallest"
            " value, the simplest is selected.",
            joints=tuple(
                _joint(
                    curve,
                    joint_fits,
                    robot,
                    model,
                    CLEARLY_BETTER,
                    tuple((beside or {}).get(curve.joint, ())),
                )
                for curve, joint_fits in zip(curves, fits, strict=True)
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
    beside: tuple[ComparedFriction, ...],
) -> JointFriction:
    j = robot.joint_names.index(curve.joint)
    unit, torque_unit = robot.joints[j].unit, robot.joints[j].torque_unit
    speed = np.linspace(0.0, 1.05 * float(curve.speed.max()), LINE_POINTS)
    speed[0] = 1e-3 * speed[-1]
    lines = {f"{fit.name} (best)" if fit is fits[0] else fit.name: fit for fit in fits[:2]}
    torque: dict[str, Numbers] = {
        name: tuple(_odd(fit.torque, speed).tolist()) for name, fit in lines.items()
    }
    graded = _grade(curve, fits)
    sentence = _sentence(curve, fits, graded, clearly_better)
    if model is not None:
        torque["the model file"] = tuple(_odd(lambda v: model.torque(j, v), speed).tolist())
        error = curve.odd - _odd(lambda v: model.torque(j, v), curve.speed)
        rms = np.sqrt(np.mean(error**2))
        conditions = model.conditions_in_words(j)
        sentence += f" The model file, {conditions}, is" if conditions else " The model file is"
        sentence += (
            f" off by {rms:.3g} {torque_unit} RMS,"
            f" {100.0 * rms / np.sqrt(np.mean(curve.odd**2)):.2g} %."
        )
    for other in beside:
        if other.percent is not None:
            more = "more" if other.percent > 0.0 else "less"
            sentence += f" In run {other.label!r}, friction is {abs(other.percent):.2g} % {more}."
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
        beside=beside or None,
    )


def _grade(curve: FrictionCurve, fits: tuple[FrictionFit, ...]) -> FitGrade | None:
    """Grade the best model by its error relative to friction and noise; None without a model."""
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
    """Return a sentence with the best model and the lines for the robot file."""
    if not fits or graded is None:
        return f"{curve.joint}: too few speeds to fit a model; measure at more speeds."
    best = fits[0]
    if graded.grade is Grade.BAD:
        return (
            f"{curve.joint}: no model fits; {best.name} is closest. Check the curve in the report"
            " for a joint that warms up or slips, and measure again."
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
