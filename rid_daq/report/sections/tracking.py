"""How closely paths were followed: `TrackingSection` before and after compensation.

`DrivenTiming` is the same before and after a path was timed to its limits, with what that took.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Final

import numpy as np
from pydantic import Strict

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from rid_daq.blocks.formats import number
from rid_daq.report.sections.section import Numbers, Section, Texts, rounded, units
from rid_daq.report.sections.verdict import VerdictCheck, VerdictSection

if TYPE_CHECKING:
    from compensation.feedforward.deflection import Deflection
    from compensation.feedforward.tracking_error import TrackingError

DRAWN_POINTS = 500
DRAWN_SHARE = 0.12
SHORTER_PERCENT = 20.0
MEASURED_PERCENT = 102.0
CLOSE_AS_BEFORE = 3.0
ENCODERS_AT_MOTORS: Final = (
    "The path is computed from the encoders at the motors: it does not contain the bending of gears"
    " and links, so the tool itself can be farther away."
)
MOTOR_TORQUES: Final = (
    "the measured motor torques (gravity, friction and the motors' own inertia included)"
)
STILL_M = 1e-9
"""A tool point that moves less stands still."""
Columns = Annotated[tuple[Numbers, ...], Strict(False)]


@dataclass(frozen=True)
class FollowedRun:
    """How closely one run followed its path.

    Attributes:
        error: Over the run's main part.
        drawn: The rows to draw: the last period, or all.
        sample_period_s: Time between rows [s].
        deflection: Estimated bending of the gears, if the stiffness of one is known.
    """

    error: TrackingError
    drawn: slice
    sample_period_s: float
    deflection: Deflection | None = None


class Bending(Section):
    """Estimated bending of the gears whose stiffness is known, at the tool point.

    Attributes:
        rms_m, max_m: RMS and largest value over the motion [m].
    """

    rms_m: float
    max_m: float


class ErrorSize(Section):
    """The size of a run's errors.

    Attributes:
        mean_m, max_m: Distance of the tool point from its path [m].
        joint_peak: Largest error of each joint [rad or m].
        bending: What the gears bend the tool by, which none of these contains; None if no stiffness
            is known.
    """

    mean_m: float
    max_m: float
    joint_peak: Numbers
    bending: Bending | None = None

    @classmethod
    def of(cls, run: FollowedRun) -> ErrorSize:
        """Return the size of a run's errors."""
        bent = run.deflection
        bending = None if bent is None else Bending(rms_m=bent.rms_m, max_m=bent.max_m)
        return cls.from_attributes(run.error, bending=bending)


class PathCurves(Section):
    """A run's path and errors over time, thinned for drawing.

    Attributes:
        time_s: [s].
        wanted_m, deviation_m: The tool point's path in the base frame and how far the robot was
            from it, x, y and z [m].
        distance_m: The size of the deviation [m].
        joint: Wanted minus reached, one a joint [rad or m].
    """

    time_s: Numbers
    wanted_m: Columns
    deviation_m: Columns
    distance_m: Numbers
    joint: Columns

    @classmethod
    def of(cls, run: FollowedRun) -> PathCurves:
        """Return the rows to draw, so many that a figure shows all there is to see."""
        error, period = run.error, run.drawn
        wanted, reached = error.wanted_m[period], error.reached_m[period]
        kept = slice(None, None, max(1, len(wanted) // DRAWN_POINTS))

        def columns(values: FloatArray) -> Columns:
            return tuple(rounded(column) for column in values.T)

        times = run.sample_period_s * np.arange(len(wanted), dtype=np.float64)
        return cls(
            time_s=rounded(times[kept]),
            wanted_m=columns(wanted[kept]),
            deviation_m=columns((reached - wanted)[kept]),
            distance_m=rounded(error.distance_m[period][kept]),
            joint=columns(error.joint[period][kept]),
        )


class DrawnPaths(Section):
    """The paths of a motion: with compensation and, where there is such a run, without."""

    after: PathCurves
    before: PathCurves | None


class FollowedMotion(Section):
    """One motion: how closely it was followed, and by which use of its own runs.

    Attributes:
        sentence: What was driven.
        use: Whether runs of this motion have made its feedforward.
        after, before: With compensation and, where there is such a run, without.
        mean_ratio, max_ratio: By how many times mean and largest distance have shrunk.
        drawn: The curves.
    """

    sentence: str
    use: str
    after: ErrorSize
    before: ErrorSize | None
    mean_ratio: float | None
    max_ratio: float | None
    drawn: DrawnPaths

    @classmethod
    def of(
        cls, sentence: str, use: str, after: FollowedRun, before: FollowedRun | None
    ) -> FollowedMotion:
        """Return what is said of a motion that was driven with compensation, and without."""
        one, other = after.error, None if before is None else before.error
        return cls(
            sentence=sentence,
            use=use,
            after=ErrorSize.of(after),
            before=None if before is None else ErrorSize.of(before),
            mean_ratio=None if other is None else other.mean_m / max(one.mean_m, 1e-12),
            max_ratio=None if other is None else other.max_m / max(one.max_m, 1e-12),
            drawn=DrawnPaths(
                after=PathCurves.of(after),
                before=None if before is None else PathCurves.of(before),
            ),
        )


class JointUnit(Section):
    """A joint, and the unit of its position."""

    joint: str
    unit: str


class TrackingSection(Section):
    """The table of all motions, and what their figures draw.

    Attributes:
        sentence: What is compared.
        joints: The robot's joints.
        motions: One a motion.
        unseen: What the encoders do not see, and its size if known.
        with_stiffness, without_stiffness: Joints whose gear's stiffness robot file or model has,
            and those that are missing.
    """

    sentence: str
    joints: tuple[JointUnit, ...]
    motions: tuple[FollowedMotion, ...]
    unseen: str
    with_stiffness: Texts
    without_stiffness: Texts

    @classmethod
    def of(
        cls,
        motions: Sequence[FollowedMotion],
        robot: RobotDescription,
        more: str = "",
        torques: str = MOTOR_TORQUES,
    ) -> TrackingSection:
        """Return the section of some motions of a robot; `more` is said besides.

        `torques` says from which torques the bending was estimated.
        """
        return cls(
            sentence="Distance between the tool point wanted and reached at the same instant, by"
            " the robot file's kinematics; joint errors are wanted minus reached." + more,
            joints=JointUnit.for_each(
                joint=robot.joint_names, unit=[units(joint)[0] for joint in robot.joints]
            ),
            motions=tuple(motions),
            unseen=f"{ENCODERS_AT_MOTORS} {_bending_words(motions, robot, torques)}",
            with_stiffness=_joints_with_stiffness(robot, known=True),
            without_stiffness=_joints_with_stiffness(robot, known=False),
        )

    @property
    def verdict(self) -> VerdictSection:
        """What the report says first; nothing is judged."""
        after = [motion.after.mean_m for motion in self.motions]
        ratios = [motion.mean_ratio for motion in self.motions if motion.mean_ratio is not None]
        mean = f"Mean distance from the path at the motor encoders {number(1e3 * max(after), 3)} mm"
        mean += " at most" if len(after) > 1 else ""
        if not ratios:
            return VerdictSection.of([], mean, f"No run to compare with was given. {self.unseen}")
        least = min(ratios)
        if least < 1.0:
            changed = f"error grew {number(1.0 / max(least, 1e-12), 3)} times"
            changed += " at most" if len(ratios) > 1 else ""
        else:
            changed = f"error reduced {number(least, 3)} times"
            changed += " at least" if len(ratios) > 1 else ""
        two = "Before and after are two runs of the same motion."
        return VerdictSection.of([], f"{mean}: {changed}", f"{two} {self.unseen}")


def _joints_with_stiffness(robot: RobotDescription, *, known: bool) -> tuple[str, ...]:
    return tuple(
        joint.name for joint in robot.joints if (joint.stiffness_nm_rad is not None) == known
    )


def _bending_words(motions: Sequence[FollowedMotion], robot: RobotDescription, torques: str) -> str:
    """Say how much the gears bend the tool, as far as their stiffness is known."""
    bent = [motion.after.bending for motion in motions if motion.after.bending is not None]
    missing = _joints_with_stiffness(robot, known=False)
    if not bent:
        return "Its size is not known: the robot file has no stiffness_nm_rad."
    largest, rms = (max(getattr(each, key) for each in bent) for key in ("max_m", "rms_m"))
    words = (
        f"Estimated bending of the gears at the tool: {number(1e3 * largest, 2)} mm at most,"
        f" {number(1e3 * rms, 2)} mm RMS, from stiffness_nm_rad and {torques}."
    )
    lacking = f" No stiffness is known of {', '.join(missing)}." if missing else ""
    return words + lacking


def magnification(extent_m: float, deviation_m: float) -> float:
    """Return 1, 2 or 5 times a power of ten, so that a deviation is drawn as an eighth of a path.

    Args:
        extent_m: Of the path.
        deviation_m: The largest one.
    """
    wanted = DRAWN_SHARE * extent_m / max(deviation_m, 1e-9)
    power = 10.0 ** math.floor(math.log10(max(wanted, 1.0)))
    return power * max(step for step in (1.0, 2.0, 5.0) if step * power <= max(wanted, 1.0))


class DrivenPath(Section):
    """A pick-and-place path as it was driven.

    Attributes:
        sentence: What was driven.
        moving_s: How long it moves [s].
        mean_m, max_m: Distance of the tool point from its path [m].
        torque_share: The largest measured torque of each joint, over its limit.
        base_peak: The largest measured base wrench, component by component [N, N m].
    """

    sentence: str
    moving_s: float
    mean_m: float
    max_m: float
    torque_share: Numbers
    base_peak: Numbers


class DrivenTiming(Section):
    """A path that was driven before and after it was timed, pre-compensated both times.

    Attributes:
        before, after: As it was, and timed.
        components: Of the base wrench, those that are limited.
        limit: Their limits [N, N m].
        sentence: On what, by which model.
    """

    before: DrivenPath
    after: DrivenPath
    components: Texts
    limit: Numbers
    sentence: str

    @property
    def base_share(self) -> float:
        """The largest measured base reaction of the timed path, over its limit."""
        peaks = zip(self.after.base_peak, self.limit, strict=True)
        return max(peak / limit for peak, limit in peaks)

    @property
    def words(self) -> str:
        """What was gained, in a sentence."""
        before, after = self.before, self.after
        return (
            f"Pick and place in {after.moving_s:.4g} s in place of {before.moving_s:.4g} s: at most"
            f" {100.0 * max(after.torque_share):.0f} % of a torque and"
            f" {100.0 * self.base_share:.0f} % of what the base may take; mean distance"
            f" {1e3 * before.mean_m:.3f} mm before, {1e3 * after.mean_m:.3f} mm after, at the motor"
            " encoders."
        )

    @property
    def checks(self) -> list[VerdictCheck]:
        """Return what a timed path is held to when it is driven."""
        before, after = self.before, self.after
        shorter = 100.0 * (1.0 - after.moving_s / before.moving_s)
        torque, base = 100.0 * max(after.torque_share), 100.0 * self.base_share
        mean, largest = after.mean_m / before.mean_m, after.max_m / before.max_m
        return [
            VerdictCheck.of("timed path shorter by", shorter, "≥", SHORTER_PERCENT, "%"),
            VerdictCheck.of(
                "its largest measured torque, of the limit", torque, "≤", MEASURED_PERCENT, "%"
            ),
            VerdictCheck.of(
                "its largest measured base reaction, of the limit", base, "≤", 100.0, "%"
            ),
            VerdictCheck.of(
                "its mean path error, of that before", mean, "≤", CLOSE_AS_BEFORE, "times"
            ),
            VerdictCheck.of(
                "its largest path error, of that before", largest, "≤", CLOSE_AS_BEFORE, "times"
            ),
        ]
