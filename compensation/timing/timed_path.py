"""Fastest motion along a path: a scan, resampling at the cycle time, and a check of each row.

The result of the scan satisfies the limits at the points of its grid. The rows lie between these
points and are averaged. Therefore each row is checked again, against the whole model. If a row
exceeds a limit, this limit is tightened on the part of the path that the row comes from, and the
scan is repeated. No row of the result exceeds a limit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from acquisition.motion.limits import sizes_between_rows
from acquisition.motion.samples import JointTrajectory
from compensation.timing.joint_curve import JointCurve
from compensation.timing.limits import TimingLimits
from compensation.timing.path_rows import WRENCH, PathDynamics, PathRows
from compensation.timing.profile import SpeedOverPath, fastest
from compensation.timing.reach_kernels import torques_of
from compensation.timing.rows_in_time import RowsInTime, rows_in_time
from config.arrays import FloatArray
from config.errors import LimitError
from config.robot.robot import RobotDescription
from dynamics.model.one_sample import FRICTION, KIND, SampleTorque

INTERVALS: Final = 1000
WINDOW_CYCLES: Final = 2
# fraction of the limits that is kept in reserve: it saves scans and makes the motion 0.1 % longer
HEADROOM: Final = 1.5e-3
MORE: Final = 1.2  # amount by which a limit is tightened, relative to the excess
LEAST_MORE: Final = 2e-4
ATTEMPTS: Final = 60
WIDER: Final = 1.02
LONGEST_WINDOW: Final = 0.5  # fraction of the path's duration
SLOWEST: Final = 10.0
# allowed excess of finite differences over the limits; slightly below the one allowed for a stream
ROUNDING: Final = 0.009


class TorqueMargins(NamedTuple):
    """Uncertainty of torques and base wrench along rows of a motion.

    Attributes:
        torque: Shape (rows, n). N m or N.
        base: Shape (rows, 6). N, N m.
    """

    torque: FloatArray
    base: FloatArray


MarginOf = Callable[[JointTrajectory], TorqueMargins]


@dataclass(frozen=True, eq=False)
class TimedPath:
    """A path, its speed, and the resulting torques.

    Attributes:
        rows: Limits along the path.
        bounds: Shape (points, rows, 3). Bounds of the last scan.
        profile: Speed along the path, before averaging.
        in_time: Rows of the path, one per cycle.
        torque: Shape (samples, n). Torque predicted by the model [N m or N].
        wrench: Shape (samples, 6). Base wrench predicted by the model [N, N m].
        margins: Uncertainty of torque and wrench.
        window_s: Window of the average [s].
        scans: Number of scans.
    """

    rows: PathRows
    bounds: FloatArray
    profile: SpeedOverPath
    in_time: RowsInTime
    torque: FloatArray
    wrench: FloatArray
    margins: TorqueMargins | None
    window_s: float
    scans: int

    @property
    def path(self) -> JointTrajectory:
        """Positions, velocities, accelerations, one row per cycle."""
        return self.in_time.path


@dataclass(frozen=True, eq=False)
class PathTimer:
    """Retiming of paths of one robot.

    Attributes:
        torque: Model of the robot.
        limits: Limits to keep.
        cycle_s: Time between rows [s].
        margin: Function that returns the uncertainty of the torques; None for no margin.
        intervals: Intervals of the path's grid.
        positions_alone: True if the limits must also hold for speeds and accelerations from
            differences of the positions, as a stream of points is checked.
    """

    robot: RobotDescription
    torque: SampleTorque
    limits: TimingLimits
    cycle_s: float
    margin: MarginOf | None = None
    intervals: int = INTERVALS
    positions_alone: bool = False

    def timed(self, curve: JointCurve) -> TimedPath:
        """Return the fastest rows along a path, from rest to rest.

        Raises:
            LimitError: The limits cannot be kept; the message names limit and place.
        """
        search = _Search(self, curve)
        for _ in range(ATTEMPTS):
            found = search.attempt()
            if found is not None:
                return found
        raise LimitError(
            f"after {ATTEMPTS} attempts, rows of the path still exceed the limit of {search.worst}:"
            " the path bends too sharply for this cycle time. Round the path, or keep a margin",
            code="RID-TIMING-SHAPE",
        )


class _Search:
    """Repeated scan, verification and tightening."""

    def __init__(self, timer: PathTimer, curve: JointCurve) -> None:
        self._timer, self._curve = timer, curve
        dynamics = PathDynamics.of(curve, timer.robot, timer.torque, timer.intervals)
        self._rows = PathRows.of(dynamics, timer.limits)
        self._free = np.full(self._rows.rows.shape[:2], HEADROOM)
        self._most = (1.0 - HEADROOM) ** 2 * self._rows.fastest
        self._window_s = WINDOW_CYCLES * timer.cycle_s
        self._slower = 1.0
        self._profile: SpeedOverPath | None = None
        self._bounds = self._rows.bounds
        self._scans = 0
        self.worst = "nothing"
        self._columns = {label: self._columns_of(label) for label in self._rows.labels}
        rest = np.zeros_like(dynamics.position)
        self._rows.refuse_standing(
            self._margin_free(JointTrajectory(dynamics.position, rest, rest))
        )

    def attempt(self) -> TimedPath | None:
        """Scan again if a limit was tightened; return the result if its rows keep all limits.

        None means that another attempt is needed: a limit is exceeded, or margins were unknown.
        """
        timer = self._timer
        if self._profile is None:
            self._bounds = self._rows.tighten(self._free)
            self._profile = fastest(self._rows, self._bounds, most=self._most)
            self._scans += 1
            if timer.margin is not None and self._scans == 1:
                self._free = HEADROOM + self._margin_on_grid(self._profile)
                self._profile = None
                return None
        found = rows_in_time(
            self._curve, self._profile, timer.cycle_s, window_s=self._window_s, slower=self._slower
        )
        torque = np.empty_like(found.path.position)
        wrench = np.empty((len(torque), 6))
        torques_of(timer.torque.arrays, *found.path, torque, wrench)
        margins = None if timer.margin is None else timer.margin(found.path)
        if self._tighten(found, torque, wrench, margins):
            self._profile = None
            return None
        if self._widen(found.path) or self._slow(torque):
            return None
        return TimedPath(self._rows, self._bounds, self._profile, found, torque, wrench, margins,
                         self._window_s, self._scans)  # fmt: skip

    def _columns_of(self, label: str) -> list[int]:
        return [r for r, other in enumerate(self._rows.labels) if other == label]

    def _margin_free(self, path: JointTrajectory) -> FloatArray:
        """Return the margins at the grid points as fractions of each row's limit."""
        free = np.zeros(self._rows.rows.shape[:2])
        if self._timer.margin is None:
            return free
        margins = self._timer.margin(path)
        for j, joint in enumerate(self._timer.robot.joints):
            for r in self._columns[f"torque of {joint.name}"]:
                free[:, r] = margins.torque[:, j] / self._rows.size[r]
        for c, name in enumerate(WRENCH):
            for r in self._columns.get(f"{name} of the base", ()):
                free[:, r] = margins.base[:, c] / self._rows.size[r]
        return free

    def _margin_on_grid(self, profile: SpeedOverPath) -> FloatArray:
        own = self._rows.dynamics
        v = own.slope * np.sqrt(profile.x)[:, np.newaxis]
        free = np.zeros(self._rows.rows.shape[:2])
        for u in (np.append(profile.u, profile.u[-1]), np.append(profile.u[0], profile.u)):
            a = own.slope * u[:, np.newaxis] + own.bend * profile.x[:, np.newaxis]
            free = np.maximum(free, self._margin_free(JointTrajectory(own.position, v, a)))
        return free

    def _tighten(
        self,
        found: RowsInTime,
        torque: FloatArray,
        wrench: FloatArray,
        margins: TorqueMargins | None,
    ) -> bool:
        """Tighten the limits that rows exceed; return True if there are any."""
        limits, exceeded = self._timer.limits, False
        size, base = np.abs(torque), np.abs(wrench)
        if margins is not None:
            size, base = size + margins.torque, base + margins.base
        speed, acceleration = sizes_between_rows(
            found.path, self._timer.cycle_s, limits.acceleration
        )
        if self._timer.positions_alone:
            seen = with_differences(found.path.position, self._timer.cycle_s)
            more, beside = np.empty_like(seen.position), np.empty((len(seen.position), 6))
            torques_of(self._timer.torque.arrays, *seen, more, beside)
            more = _fold_rests(np.abs(more)) + (0.0 if margins is None else margins.torque)
            size = np.maximum(size, more)
            hull = sizes_between_rows(seen, self._timer.cycle_s, np.full_like(limits.speed, np.inf))
            speed = np.maximum(speed, _fold_rests(hull[0]) / (1.0 + ROUNDING))
            acceleration = np.maximum(acceleration, _fold_rests(hull[1]) / (1.0 + ROUNDING))
        names = [joint.name for joint in self._timer.robot.joints]
        for what, values, limit in (
            ("torque", size, limits.torque),
            ("acceleration", acceleration, limits.acceleration),
            ("speed", speed, limits.speed),
        ):
            over = values / limit - 1.0
            for j in np.flatnonzero(over.max(axis=0) > 0.0).tolist():
                exceeded = True
                self._keep(
                    f"{what} of {names[j]}", _spread_margins(over[:, j], found, len(self._free))
                )
        if limits.base is not None:
            over = base / limits.base - 1.0
            for c in np.flatnonzero(over.max(axis=0) > 0.0).tolist():
                exceeded = True
                self._keep(
                    f"{WRENCH[c]} of the base", _spread_margins(over[:, c], found, len(self._free))
                )
        return exceeded

    def _keep(self, label: str, more: FloatArray) -> None:
        """Tighten a limit by the fraction `more` (points,) at each grid point."""
        self.worst = f"the {label}"
        for r in self._columns.get(label, ()):
            self._free[:, r] += more
        if label not in self._columns:  # the excess is that of a speed limit, which has no row
            self._most = (1.0 - more) ** 2 * self._most
        elif self._scans > ATTEMPTS // 4:  # rows that do not contain u do not react to tightening
            slower = np.minimum((1.0 - more) * self._most, 0.98 * self._last.x)
            self._most = np.where(more > 0.0, slower, self._most)

    @property
    def _last(self) -> SpeedOverPath:
        assert self._profile is not None
        return self._profile

    def _widen(self, path: JointTrajectory) -> bool:
        """Average over a longer window if torques or accelerations change too fast."""
        limits, cycle_s = self._timer.limits, self._timer.cycle_s
        worst, what = 1.0, ""
        for name, limit, values in (
            ("jerk", limits.jerk, path.acceleration),
            ("torque rate", limits.torque_rate, None),
        ):
            if limit is None:
                continue
            changing = self._without_friction(path) if values is None else values
            ratio = (np.abs(np.diff(changing, axis=0)) / cycle_s / limit).max(axis=0)
            if ratio.max() > worst:
                joint = self._timer.robot.joints[int(ratio.argmax())].name
                worst, what = float(ratio.max()), f"the {name} of {joint}"
        if worst <= 1.0:
            return False
        self.worst = what
        self._window_s = max(
            self._window_s * min(1.5, WIDER * worst), self._window_s + self._timer.cycle_s
        )
        if self._window_s > LONGEST_WINDOW * self._last.time_s[-1]:
            raise LimitError(
                f"{what} exceeds its limit even with averaging over half of the motion's time:"
                " raise the limit, or drive more slowly",
                code="RID-TIMING-NOT-FEASIBLE",
            )
        return True

    def _without_friction(self, path: JointTrajectory) -> FloatArray:
        arrays = self._timer.torque.arrays
        table = np.ascontiguousarray(arrays[4][arrays[4][:, KIND] != FRICTION])
        torque, wrench = np.empty_like(path.position), np.empty((len(path.position), 6))
        torques_of((*arrays[:4], table, *arrays[5:]), *path, torque, wrench)
        return torque

    def _slow(self, torque: FloatArray) -> bool:
        """Slow down if a motor's RMS torque is too large."""
        limit = self._timer.limits.torque_rms
        if limit is None:
            return False
        ratio = np.sqrt(np.mean(torque**2, axis=0)) / limit
        if ratio.max() <= 1.0:
            return False
        name = self._timer.robot.joints[int(ratio.argmax())].name
        self.worst = f"the RMS torque of {name}"
        self._slower *= float(np.clip(np.sqrt(ratio.max()), 1.002, 1.5))
        if self._slower > SLOWEST:
            raise LimitError(
                f"{self.worst} is {ratio.max():.3g} times its limit even if the motion is"
                f" {SLOWEST:g} times slower, because of gravity and friction. Raise the limit (time"
                " at rest does not count), or choose poses with less torque from gravity",
                code="RID-TIMING-NOT-FEASIBLE",
            )
        return True


def _spread_margins(over: FloatArray, found: RowsInTime, points: int) -> FloatArray:
    """Return the fraction of exceeded limits to hold in reserve at each grid point."""
    rows = np.flatnonzero(over > 0.0)
    more = np.zeros(points)
    begin, end = found.begin[rows], found.end[rows] + 1
    for ahead in range(int((end - begin).max()) + 1):
        np.maximum.at(more, np.minimum(begin + ahead, end), MORE * over[rows] + LEAST_MORE)
    return more


def with_differences(position: FloatArray, step_s: float) -> JointTrajectory:
    """Return positions with five-point differences, extended by two rows of rest at each end."""
    q = np.concatenate([position[[0] * 4], position, position[[-1] * 4]])
    a2, a1, own, b1, b2 = (q[k : len(q) - 4 + k] for k in range(5))
    velocity = (8.0 * (b1 - a1) - (b2 - a2)) / (12.0 * step_s)
    change = (16.0 * (b1 + a1) - 30.0 * own - (b2 + a2)) / (12.0 * step_s**2)
    return JointTrajectory(np.ascontiguousarray(own), velocity, change)


def _fold_rests(sizes: FloatArray) -> FloatArray:
    """Include the rest rows' values in the first and last row of the path, as maxima."""
    own = sizes[2:-2].copy()
    own[0] = sizes[:3].max(axis=0)
    own[-1] = sizes[-3:].max(axis=0)
    return own
