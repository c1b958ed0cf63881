"""Path errors of driven motions: `TrackingSection` before and after compensation."""

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
from rid_daq.report.sections.section import Numbers, Section, Texts, round_values
from rid_daq.report.sections.verdict import VerdictSection
from rid_daq.report.tool_error_entries import ToolDeflection, ToolSideSize

if TYPE_CHECKING:
    from compensation.feedforward.deflection import Deflection
    from compensation.feedforward.tracking_error import TrackingError

DRAWN_POINTS = 500
DRAWN_SHARE = 0.12
WHOLE: Final = 0.9
"""Share of a motion above which an instrument has measured it as a whole."""
CONTRADICTION: Final = 2.0
"""Ratio of measured to estimated error at the tool above which the estimate is called wrong."""
LARGEST_NOISE_M: Final = 2e-4
"""Mean distance that the noise of an instrument can cause."""
ENCODERS_AT_MOTORS: Final = (
    "The path is computed from the encoders at the motors. It does not contain the deflection of"
    " gears and links, so the true distance of the tool from the path can be larger."
)
MOTOR_TORQUES: Final = (
    "the measured motor torques (gravity, friction and the motors' own inertia included)"
)
STILL_M = 1e-9  # extent of a path below which the tool point counts as standing still
Columns = Annotated[tuple[Numbers, ...], Strict(False)]


@dataclass(frozen=True)
class FollowedRun:
    """Path error of one run.

    Attributes:
        error: Error over the main part of the run.
        drawn: Rows to draw: the last period, or all rows.
        sample_period_s: Time between rows [s].
        deflection: Estimated deflection of the gears; None if no stiffness is known.
    """

    error: TrackingError
    drawn: slice
    sample_period_s: float
    deflection: Deflection | None = None


class ErrorSize(Section):
    """Size of the errors of a run.

    Attributes:
        mean_m: Mean distance of the tool point, as the motor encoders see it, from its path [m].
        max_m: Largest distance of this point from its path [m].
        joint_peak: Largest error of each joint [rad or m].
        bending: Estimated deflection of the gears, which the other values do not contain; left out
            if no stiffness is known.
    """

    mean_m: float
    max_m: float
    joint_peak: Numbers
    bending: ToolDeflection | None = None

    @classmethod
    def of(cls, run: FollowedRun) -> ErrorSize:
        """Return the size of a run's errors."""
        bent = None if run.deflection is None else ToolDeflection.of(run.deflection)
        return cls.from_attributes(run.error, bending=bent)


class PathCurves(Section):
    """Path and errors of a run over the times `time_s` [s], thinned for drawing.

    Attributes:
        wanted_m: Desired path of the tool point in the base frame, as x, y and z [m].
        deviation_m: Reached minus desired tool point in the base frame, as x, y and z [m].
        distance_m: Magnitude of the deviation [m].
        joint: Desired minus reached position of each joint [rad or m].
    """

    time_s: Numbers
    wanted_m: Columns
    deviation_m: Columns
    distance_m: Numbers
    joint: Columns

    @classmethod
    def of(cls, run: FollowedRun) -> PathCurves:
        """Return the curves of a run with about `DRAWN_POINTS` points."""
        error, period = run.error, run.drawn
        wanted, reached = error.wanted_m[period], error.reached_m[period]
        kept = slice(None, None, max(1, len(wanted) // DRAWN_POINTS))

        def columns(values: FloatArray) -> Columns:
            return tuple(round_values(column) for column in values.T)

        times = run.sample_period_s * np.arange(len(wanted), dtype=np.float64)
        return cls(
            time_s=round_values(times[kept]),
            wanted_m=columns(wanted[kept]),
            deviation_m=columns((reached - wanted)[kept]),
            distance_m=round_values(error.distance_m[period][kept]),
            joint=columns(error.joint[period][kept]),
        )


class DrawnPaths(Section):
    """Curves of a run, and of the run that it is compared with.

    Attributes:
        after: Curves of the run, which usually has compensation.
        before: Curves of the run to compare with, usually without compensation; null if there is
            none.
    """

    after: PathCurves
    before: PathCurves | None


class FollowedMotion(Section):
    """Path errors of one motion in a run, and in the run that it is compared with.

    Attributes:
        sentence: Description of the motion.
        use: "plain" without compensation, "streamed" if it was computed online; for a feedforward,
            its use of runs of this motion: "never used", "tuned on it", or "refined N times".
        after: Errors of the run, which usually has compensation.
        before: Errors of the run to compare with, usually without compensation; null if there is
            none.
        mean_ratio: Mean distance in `before` divided by that in `after`; null if `before` is null.
        max_ratio: Largest distance in `before` divided by that in `after`; null if `before` is
            null.
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
        """Return the errors of a motion from a run and the run to compare with."""
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
    """Name and position unit of a joint.

    Attributes:
        joint: Name of the joint.
        unit: Unit of the joint's position.
    """

    joint: str
    unit: str


class TrackingSection(Section):
    """Path errors of all motions.

    Attributes:
        sentence: Description of the comparison.
        joints: The robot's joints.
        motions: Errors of each motion.
        unseen: A sentence on deflection, which the encoders do not measure, and its size if known.
        with_stiffness: Joints whose gear stiffness is in the robot file or the model.
        without_stiffness: Joints whose gear stiffness is unknown.
        tool_side: Errors of the runs at the tool; empty if no instrument measured them.
    """

    sentence: str
    joints: tuple[JointUnit, ...]
    motions: tuple[FollowedMotion, ...]
    unseen: str
    with_stiffness: Texts
    without_stiffness: Texts
    tool_side: tuple[ToolSideSize, ...] = ()

    @classmethod
    def of(
        cls,
        motions: Sequence[FollowedMotion],
        robot: RobotDescription,
        more: str = "",
        torques: str = MOTOR_TORQUES,
    ) -> TrackingSection:
        """Return the section for motions of a robot.

        Args:
            more: Additional sentence.
            torques: Name of the torques from which the deflection was estimated.
        """
        return cls(
            sentence="Distance between the desired and the reached tool point at the same"
            " instant, computed with the robot file's kinematics. Joint errors are"
            " desired minus reached position." + more,
            joints=JointUnit.for_each(
                joint=robot.joint_names, unit=[joint.unit for joint in robot.joints]
            ),
            motions=tuple(motions),
            unseen=f"{ENCODERS_AT_MOTORS} {_deflection_sentence(motions, robot, torques)}",
            with_stiffness=_joints_with_stiffness(robot, known=True),
            without_stiffness=_joints_with_stiffness(robot, known=False),
        )

    @property
    def _tool_ratios(self) -> list[float]:
        """Ratios of the tool's estimated errors; empty if the deflection of a run is unknown."""
        ratios = []
        for motion in self.motions:
            if motion.before is None:
                continue
            sizes = [
                None if size.bending is None else size.bending.tool_mean_m
                for size in (motion.before, motion.after)
            ]
            if sizes[0] is None or sizes[1] is None:
                return []
            ratios.append(sizes[0] / max(sizes[1], 1e-12))
        return ratios

    @property
    def contradiction(self) -> str:
        """A sentence if an instrument measured much more than was estimated; otherwise empty."""
        for motion, size in zip(self.motions, self.tool_side, strict=bool(self.tool_side)):
            bent = motion.after.bending
            estimate = None if bent is None else bent.tool_mean_m
            if estimate is not None and size.mean_m > max(
                CONTRADICTION * estimate, LARGEST_NOISE_M
            ):
                return (
                    f"The instrument measured a mean distance of {number(1e3 * size.mean_m, 2)} mm"
                    f" at the tool in {size.file}, but the estimate from stiffness and model is"
                    f" {number(1e3 * estimate, 2)} mm: the measured value counts."
                )
        return ""

    @property
    def verdict(self) -> VerdictSection:
        """Headline of the report; no limit is checked."""
        after = [motion.after.mean_m for motion in self.motions]
        ratios = [motion.mean_ratio for motion in self.motions if motion.mean_ratio is not None]
        mean = f"Mean distance from the path at the motor encoders {number(1e3 * max(after), 3)} mm"
        mean += " at most" if len(after) > 1 else ""
        if self.tool_side:
            worst = max(size.mean_m for size in self.tool_side)
            mean += f", at the tool {number(1e3 * worst, 3)} mm"
            least_share = min(size.share for size in self.tool_side)
            if least_share < WHOLE:
                mean += f" (measured on {100.0 * least_share:.0f} % of the motion)"
        if not ratios:
            return VerdictSection.of(
                [], mean, f"No other run was given for comparison. {self.unseen}"
            )
        changed, at_tool = f"error {_change(ratios)}", self._tool_ratios
        if self.tool_side:
            changed = f"error at the motors {_change(ratios)}"
        elif at_tool:
            changed = (
                f"error at the motors {_change(ratios)}, estimated error at the tool with the"
                f" deflection of the gears {_change(at_tool)}"
            )
        two = "The errors before and after are those of two runs of the same motion."
        return VerdictSection.of([], f"{mean}: {changed}", f"{two} {self.unseen}")


def _change(ratios: Sequence[float]) -> str:
    """Return the change of the errors in words, by the smallest ratio of error before to after."""
    least = min(ratios)
    if least < 1.0:
        words = f"increased {number(1.0 / max(least, 1e-12), 3)}-fold"
        return words + (" at most" if len(ratios) > 1 else "")
    return f"reduced {number(least, 3)}-fold" + (" at least" if len(ratios) > 1 else "")


def _joints_with_stiffness(robot: RobotDescription, *, known: bool) -> tuple[str, ...]:
    return tuple(
        joint.name for joint in robot.joints if (joint.stiffness_nm_rad is not None) == known
    )


def _deflection_sentence(
    motions: Sequence[FollowedMotion], robot: RobotDescription, torques: str
) -> str:
    """Return a sentence on the deflection of the gears whose stiffness is known."""
    bent = [motion.after.bending for motion in motions if motion.after.bending is not None]
    missing = _joints_with_stiffness(robot, known=False)
    if not bent:
        return "The size of this deflection is not known: the robot file has no stiffness_nm_rad."
    largest, rms = (max(getattr(each, key) for each in bent) for key in ("max_m", "rms_m"))
    runs = [run for motion in motions for run in (motion.before, motion.after) if run is not None]
    tool = [run.bending.tool_mean_m for run in runs if run.bending and run.bending.tool_mean_m]
    words = (
        f"Estimated deflection of the gears at the tool: {number(1e3 * largest, 2)} mm at most,"
        f" {number(1e3 * rms, 2)} mm RMS, from stiffness_nm_rad and {torques}."
    )
    if tool:
        sizes = ", ".join(number(1e3 * each, 2) for each in tool)
        words += f" Estimated mean distance of the tool from its path: {sizes} mm (run by run)."
    return words + (f" The stiffness of {', '.join(missing)} is not known." if missing else "")


def magnification(extent_m: float, deviation_m: float) -> float:
    """Return the magnification that draws a deviation as at most `DRAWN_SHARE` of the path.

    The magnification is 1, 2 or 5 times a power of ten, at least 1.

    Args:
        extent_m: Size of the path.
        deviation_m: Largest deviation.
    """
    wanted = DRAWN_SHARE * extent_m / max(deviation_m, 1e-9)
    power = 10.0 ** math.floor(math.log10(max(wanted, 1.0)))
    return power * max(step for step in (1.0, 2.0, 5.0) if step * power <= max(wanted, 1.0))
