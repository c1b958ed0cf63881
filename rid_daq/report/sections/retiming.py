"""`RetimingSection`: a path retimed to its limits, with its duration and the active limits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from rid_daq.report.driven_timing_entry import DrivenTiming
from rid_daq.report.sections.section import (
    Numbers,
    Section,
    round_values,
    thinning_slice,
)
from rid_daq.report.sections.verdict import VerdictCheck

if TYPE_CHECKING:
    from acquisition.motion.samples import JointTrajectory
    from compensation.timing.limits import TimingLimits
    from compensation.timing.timed_motion import TimedMotion
    from compensation.timing.timed_path import TimedPath

REACHED: Final = 0.98
CHANGES: Final = "a change of acceleration"
PERIODIC: Final = (
    " The motion was periodic. The retimed motion contains all its periods, including those for"
    " settling, but it is not periodic itself, so its recording has no periods."
)
WRENCH: Final = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")


class RetimedJoint(Section):
    """Largest values of a joint on a retimed path, with their limits.

    Attributes:
        joint: Name of the joint.
        unit: Unit of the joint's torque.
        torque_limit: Torque limit, reduced by the fraction `margin` [N m or N].
        torque_peak: Largest absolute torque of the model [N m or N].
        torque_margin: Largest margin for the uncertainty of the torque [N m or N].
        torque_uncertain_peak: Largest sum of absolute torque and margin [N m or N].
        torque_rms: RMS torque of the model [N m or N].
        speed_share: Largest speed divided by its limit.
        acceleration_share: Largest acceleration divided by its limit.
    """

    joint: str
    unit: str
    torque_limit: float
    torque_peak: float
    torque_margin: float
    torque_uncertain_peak: float
    torque_rms: float
    speed_share: float
    acceleration_share: float


class BaseShare(Section):
    """One component of the base wrench on a retimed path [N or N m].

    Attributes:
        component: Name of the component.
        limit: Limit of the component.
        peak: Largest absolute value that the model predicts.
        margin: Largest margin for the uncertainty of the component.
    """

    component: str
    limit: float
    peak: float
    margin: float


class ReachedLimit(Section):
    """Interval in which one limit is the active one.

    Attributes:
        begin_s: Start of the interval [s].
        end_s: End of the interval [s].
        limit: Name of the active limit; "a change of acceleration" if no limit is reached.
    """

    begin_s: float
    end_s: float
    limit: str


class RetimedWay(Section):
    """Curves of one part of the path, which leads from rest to rest.

    Attributes:
        place: Lengths along the path at which `speed` and `limit` are given.
        speed: Speed of the path at each length.
        limit: Limit curve of this speed at each length.
        time_s: Times since the start of the part [s].
        torques: Torque of each joint, divided by its limit.
        margins: Allowance for the uncertainty of each joint's torque, divided by its limit; 0
            if the timing allows for none.
        reached: The active limit of each interval.
        done: Completed fraction of the part at `time_s`.
        original_s: Times of the original motion [s].
        original_done: Completed fraction of the part at `original_s`.
        measured: Measured torque of each joint at `time_s`, divided by its limit; left out if the
            path was not driven.
    """

    place: Numbers
    speed: Numbers
    limit: Numbers
    time_s: Numbers
    torques: tuple[Numbers, ...]
    margins: tuple[Numbers, ...]
    reached: tuple[ReachedLimit, ...]
    done: Numbers
    original_s: Numbers
    original_done: Numbers
    measured: tuple[Numbers, ...] | None = None


class RetimingSection(Section):
    """A path retimed to its limits.

    Attributes:
        motion: Original motion file.
        model: Model file that predicted the torques.
        cycle_s: Time between rows [s].
        original_s: Duration of the original motion, without rests [s].
        moving_s: Duration of the retimed motion, without rests [s].
        rows: Number of rows that were checked against the model.
        scans: Number of scans of the path that the computation needed until all limits were kept;
            of several parts, the largest number.
        confidence: Probability with which each torque is within its limit at one instant; null if
            the timing makes no allowance for the uncertainty of the torques.
        margin: Additional fraction of the limits of torques and base wrench that is kept free.
        averaged_s: Longest window of the moving average that smooths the motion [s].
        joints: Largest values of each joint.
        base: Largest values of the base wrench; left out if it is not limited.
        ways: Curves of each part of the path from rest to rest.
        was_periodic: True if the original motion had periods; the retimed motion has none. Left out
            otherwise.
        driven: Measurements on a robot; left out if the path was not driven.
    """

    motion: str
    model: str
    cycle_s: float
    original_s: float
    moving_s: float
    rows: int
    scans: int
    confidence: float | None
    margin: float
    averaged_s: float
    joints: tuple[RetimedJoint, ...]
    base: tuple[BaseShare, ...] | None = None
    ways: tuple[RetimedWay, ...]
    was_periodic: bool | None = None
    driven: DrivenTiming | None = None

    @classmethod
    def of(
        cls,
        timed: TimedMotion,
        robot: RobotDescription,
        limits: TimingLimits,
        *,
        named: tuple[str, str],
        confidence: float,
        margin: float,
    ) -> RetimingSection:
        """Return the section of a retimed motion.

        Args:
            named: Names of the motion and of the model.
        """
        torque = np.concatenate([way.torque for way in timed.ways])
        uncertain = np.concatenate([_margins(way)[0] for way in timed.ways])
        v, a = (np.concatenate([way.path[k] for way in timed.ways]) for k in (1, 2))
        joints = [
            RetimedJoint(
                joint=joint.name,
                unit=joint.torque_unit,
                torque_limit=float(limits.torque[j]),
                torque_peak=float(np.abs(torque[:, j]).max()),
                torque_margin=float(uncertain[:, j].max()),
                torque_uncertain_peak=float((np.abs(torque[:, j]) + uncertain[:, j]).max()),
                torque_rms=float(np.sqrt(np.mean(torque[:, j] ** 2))),
                speed_share=float(np.abs(v[:, j]).max() / limits.speed[j]),
                acceleration_share=float(np.abs(a[:, j]).max() / limits.acceleration[j]),
            )
            for j, joint in enumerate(robot.joints)
        ]
        base = None
        if limits.base is not None:
            wrench = np.concatenate([np.abs(way.wrench) for way in timed.ways])
            open_too = np.concatenate([_margins(way)[1] for way in timed.ways])
            base = tuple(
                BaseShare(
                    component=name,
                    limit=float(limits.base[c]),
                    peak=float(wrench[:, c].max()),
                    margin=float(open_too[:, c].max()),
                )
                for c, name in enumerate(WRENCH)
                if np.isfinite(limits.base[c])
            )
        return cls(
            motion=named[0],
            model=named[1],
            cycle_s=timed.motion.cycle_time_s,
            original_s=timed.original_s,
            moving_s=timed.moving_s,
            rows=len(torque),
            scans=max(way.scans for way in timed.ways),
            confidence=confidence or None,
            margin=margin,
            averaged_s=max(way.window_s for way in timed.ways),
            joints=tuple(joints),
            base=base,
            ways=tuple(
                _way(way, place, robot, limits, timed.motion.cycle_time_s)
                for way, place in zip(timed.ways, timed.places, strict=True)
            ),
            was_periodic=timed.was_periodic or None,
        )

    def with_driven(self, driven: DrivenTiming, torque: FloatArray) -> RetimingSection:
        """Return the section with measurements; the path must be a single part from rest to rest.

        Args:
            driven: Comparison of the original and the retimed path.
            torque: Shape (rows, n). Measured torques, divided by the limits.
        """
        (way,) = self.ways
        rows = torque[thinning_slice(len(torque))]
        drawn = way.model_copy(
            update={"measured": tuple(round_values(column) for column in rows.T)}
        )
        return self.model_copy(update={"driven": driven, "ways": (drawn,)})

    @property
    def shorter_percent(self) -> float:
        """Reduction of the duration [%]; negative if the retimed motion takes longer."""
        return 100.0 * (1.0 - self.moving_s / self.original_s)

    @property
    def checks(self) -> tuple[VerdictCheck, ...]:
        """Comparison of each joint's torque, margin included, with the joint's limit."""
        return tuple(
            VerdictCheck.of(
                f"torque of {joint.joint} with its margin",
                joint.torque_uncertain_peak,
                "≤",
                joint.torque_limit,
                joint.unit,
            )
            for joint in self.joints
        )

    @property
    def sentence(self) -> str:
        """Duration before and after retiming, in words."""
        change = self.shorter_percent
        word = "shorter" if change >= 0.0 else "longer, because of the limits"
        kept = (
            "according to the model"
            if self.confidence is None
            else f"with a confidence of {100.0 * self.confidence:g} %"
        )
        return (
            f"The path takes {self.moving_s:.4g} s instead of {self.original_s:.4g} s"
            f" ({abs(change):.1f} % {word}). {self.rows} rows were checked against the model: no"
            f" row exceeds a limit {kept}." + (PERIODIC if self.was_periodic else "")
        )


def _way(
    way: TimedPath,
    original: FloatArray,
    robot: RobotDescription,
    limits: TimingLimits,
    cycle_s: float,
) -> RetimedWay:
    from compensation.timing.profile import limit_curve

    points = thinning_slice(len(way.profile.length))
    rows = thinning_slice(len(way.torque))
    curve = np.sqrt(limit_curve(way.rows, way.rows.bounds))
    time_s: FloatArray = np.arange(len(way.torque), dtype=np.float64) * cycle_s
    before = thinning_slice(len(original))
    original_s: FloatArray = np.arange(len(original), dtype=np.float64) * cycle_s
    shares, margins = way.torque / limits.torque, _margins(way)[0] / limits.torque
    return RetimedWay(
        place=round_values(way.profile.length[points]),
        speed=round_values(np.sqrt(way.profile.x[points])),
        limit=round_values(curve[points]),
        time_s=round_values(time_s[rows]),
        torques=tuple(round_values(column) for column in shares[rows].T),
        margins=tuple(round_values(column) for column in margins[rows].T),
        reached=_find_reached_limits(way, robot, limits, time_s),
        done=round_values(way.in_time.length[rows] / original[-1]),
        original_s=round_values(original_s[before]),
        original_done=round_values(original[before] / original[-1]),
    )


def _margins(way: TimedPath) -> tuple[FloatArray, FloatArray]:
    if way.margins is None:
        return np.zeros_like(way.torque), np.zeros_like(way.wrench)
    return way.margins


def _find_reached_limits(
    way: TimedPath, robot: RobotDescription, limits: TimingLimits, time_s: FloatArray
) -> tuple[ReachedLimit, ...]:
    """Return the intervals of the retimed path with the limit that is reached in each."""
    torque, wrench = _margins(way)
    path: JointTrajectory = way.path
    shares = [
        (np.abs(way.torque) + torque) / limits.torque,
        np.abs(path.velocity) / limits.speed,
        np.abs(path.acceleration) / limits.acceleration,
    ]
    names = [
        f"{what} of {joint.name}"
        for what in ("torque", "speed", "acceleration")
        for joint in robot.joints
    ]
    if limits.base is not None:
        shares.append((np.abs(way.wrench) + wrench) / limits.base)
        names += [f"{name} of the base" for name in WRENCH]
    every = np.concatenate(shares, axis=1)
    most = np.where(every.max(axis=1) >= REACHED, every.argmax(axis=1), len(names))
    edges = np.flatnonzero(np.diff(most)) + 1
    begins = [0, *edges.tolist()]
    ends = [*edges.tolist(), len(most) - 1]
    return tuple(
        ReachedLimit(
            begin_s=float(time_s[begin]),
            end_s=float(time_s[end]),
            limit=[*names, CHANGES][most[begin]],
        )
        for begin, end in zip(begins, ends, strict=True)
        if end > begin
    )
